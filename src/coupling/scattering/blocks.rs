//! The exchange between few numbers of each body, as a solve asks for it again and again at the same places: matrices of near pairs, and moments of each number.
//!
//! A body of many points answers with few charges of its own: its modes' and its twist's, [L, Ū] z. Its numbers are z, those of a body that has fewer points its charges. With
//! P = [L, Ū] or the identity, a near pair's matrix is Pᵀ (1/r) P, weighed, and the moments of a body's numbers are those of P's columns.

use super::Scattering;
use super::far::Derivatives;
use super::pairs::{Near, Weights};
use super::parts::{FEW, in_parts, of_each};
use super::places::Places;
use super::spare::Spare;
use super::sums::Sums;
use crate::adjoint::multipole::{self, WIDTH};
use crate::solver::{dot, matmul};
use faer::prelude::IntoConst;
use faer::{Accum, MatMut, MatRef};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Rows of a near pair's matrix that are taken together, and columns.
const LANES: usize = 4;
const TOGETHER: usize = 4;

/// At some places.
pub(super) struct Blocks {
    /// Moments of each number about its body's centre, number by number.
    moments: Vec<f64>,
    /// Between the cells of far pairs.
    far: Derivatives<f64>,
    /// Matrices of the near pairs in parts, each with its pairs: column by column, rows of the first body filled up to whole lanes, one pair after the other.
    near: Vec<(Range<usize>, Vec<f64>)>,
    spare: Spare<f64>,
    pub weights: Arc<Weights<f64>>,
}

impl Drop for Blocks {
    fn drop(&mut self) {
        for (_, matrices) in std::mem::take(&mut self.near) {
            self.spare.give(matrices);
        }
    }
}

/// Room for one near pair.
#[derive(Default)]
struct Room {
    /// The first body's points, filled up to eights, and their inverse distances from those of the second, column by column.
    to: [Vec<f64>; 3],
    inverse: Vec<f64>,
    /// (1/r) P of the second.
    half: Vec<f64>,
}

impl Scattering {
    /// P of a body or of what a mirror shows of it; none that is the identity.
    pub(super) fn carrier(&self, b: usize) -> Option<MatRef<'_, f64>> {
        let body = &self.bodies[b % self.bodies.len()];
        let basis = body.basis();
        (basis.ncols() < basis.nrows()).then(|| {
            MatRef::from_column_major_slice(basis.as_slice(), basis.nrows(), basis.ncols())
        })
    }
}

impl Blocks {
    pub fn new(sums: &Sums<'_, f64>) -> Self {
        let model = sums.model;
        let n = model.table.moments();
        let moments = of_each(model.numbers.len(), |b| {
            let of_points = sums.moments_of_points(b);
            let Some(carrier) = model.carrier(b) else {
                return of_points;
            };
            let of_points = MatRef::from_column_major_slice(&of_points, n, carrier.nrows());
            let mut own = vec![0.0; n * carrier.ncols()];
            let out = MatMut::from_column_major_slice_mut(&mut own, n, carrier.ncols());
            matmul(out, Accum::Replace, of_points, carrier, 1.0);
            own
        });
        let all = &sums.pairs.near;
        let near = in_parts(all, |_, pairs: &[Near]| {
            let first = pairs.first().map_or(0, |near| near.number);
            let sizes = pairs.iter().map(|near| {
                let [rows, columns] = near.bodies.map(|b| model.numbers[b].len());
                rows.next_multiple_of(LANES) * columns
            });
            let (mut out, mut room) = (model.spare.take(sizes.sum()), Room::default());
            for near in pairs {
                let weight = sums.weights.within(near.within);
                room.matrix(model, sums.places, near, weight, &mut out);
            }
            (first..first + pairs.len(), out)
        });
        Self {
            far: Derivatives::new(
                &model.table,
                sums.places,
                &sums.weights,
                &sums.pairs.far,
                &model.spare_packs,
            ),
            moments: moments.concat(),
            near,
            spare: model.spare.clone(),
            weights: sums.weights.clone(),
        }
    }

    /// What the numbers see of each other: a symmetric product, its own transpose.
    pub fn seen(&self, sums: &Sums<'_, f64>, numbers: &[f64]) -> Vec<f64> {
        let model = sums.model;
        let numbers = &*model.spread(numbers);
        let n = model.table.moments();
        let of_bodies = sums.of_bodies(n, |b, out| {
            let own = model.numbers[b].clone();
            let columns = self.moments[n * own.start..n * own.end].chunks_exact(n);
            for (column, x) in columns.zip(&numbers[own]) {
                for (out, m) in out.iter_mut().zip(column) {
                    *out += x * m;
                }
            }
        });
        let (locals, _) = sums.locals(&sums.upward(&of_bodies), false, Some(&self.far));
        let mut out = self.near(sums, numbers);
        for (own, leaf) in model.numbers.iter().zip(&model.cells.leaf) {
            let local = &locals[n * leaf..][..n];
            let columns = self.moments[n * own.start..n * own.end].chunks_exact(n);
            for (out, column) in out[own.clone()].iter_mut().zip(columns) {
                *out += dot(local, column);
            }
        }
        model.gathered(out)
    }

    fn near(&self, sums: &Sums<'_, f64>, numbers: &[f64]) -> Vec<f64> {
        let model = sums.model;
        let part = |(pairs, matrices): &(Range<usize>, Vec<f64>)| {
            let mut out = vec![0.0; numbers.len()];
            multipole::vectorized(
                #[inline(always)]
                || {
                    let mut rest = &matrices[..];
                    let (mut own, mut seen) = (Vec::new(), Vec::new());
                    for near in &sums.pairs.near[pairs.clone()] {
                        let [a, b] = near.bodies.map(|b| model.numbers[b].clone());
                        let stride = a.len().next_multiple_of(LANES);
                        let (matrix, after) = rest.split_at(stride * b.len());
                        rest = after;
                        own.clear();
                        own.extend_from_slice(&numbers[a.clone()]);
                        own.resize(stride, 0.0);
                        seen.clear();
                        seen.resize(stride, 0.0);
                        let mut columns = matrix.chunks_exact(TOGETHER * stride);
                        let mut others = numbers[b.clone()].chunks_exact(TOGETHER);
                        let mut seen_b = out[b].chunks_exact_mut(TOGETHER);
                        for ((x, out), columns) in (&mut others).zip(&mut seen_b).zip(&mut columns)
                        {
                            both::<TOGETHER>(columns, [&own, x], [&mut seen, out]);
                        }
                        let left = others.remainder().iter().zip(seen_b.into_remainder());
                        for ((x, out), column) in left.zip(columns.remainder().chunks_exact(stride))
                        {
                            both::<1>(
                                column,
                                [&own, &[*x]],
                                [&mut seen, std::slice::from_mut(out)],
                            );
                        }
                        for (out, x) in out[a].iter_mut().zip(&seen) {
                            *out += x;
                        }
                    }
                },
            );
            out
        };
        let mut out = vec![0.0; numbers.len()];
        let parts: Vec<_> = match sums.pairs.near.len() < FEW {
            true => self.near.iter().map(part).collect(),
            false => self.near.par_iter().map(part).collect(),
        };
        for seen in parts {
            out.iter_mut().zip(seen).for_each(|(out, x)| *out += x);
        }
        out
    }
}

impl Room {
    /// Adds the matrix of a pair to a list.
    fn matrix(
        &mut self,
        model: &Scattering,
        places: &Places<f64>,
        near: &Near,
        weight: f64,
        out: &mut Vec<f64>,
    ) {
        let [a, b] = near.bodies.map(|b| model.points[b].clone());
        let [rows, columns] = near.bodies.map(|b| model.numbers[b].len());
        let stride = a.len().next_multiple_of(WIDTH);
        // Beyond the last point it stands again.
        for (own, all) in self.to.iter_mut().zip(&places.points) {
            own.clear();
            own.extend_from_slice(&all[a.clone()]);
            own.resize(stride, all[a.end - 1]);
        }
        self.inverse.resize(b.len() * stride, 0.0);
        multipole::vectorized(
            #[inline(always)]
            || {
                let to = [&self.to[0][..], &self.to[1], &self.to[2]];
                for (j, inverse) in b.clone().zip(self.inverse.chunks_exact_mut(stride)) {
                    multipole::inverse_distances(&places.point(j), to, inverse);
                }
            },
        );
        let room = rows.next_multiple_of(LANES);
        let carriers = near.bodies.map(|b| model.carrier(b));
        let all = &self.inverse[..b.len() * stride];
        let start = out.len();
        out.resize(start + room * columns, 0.0);
        let own = &mut out[start..];
        let fill = |own: &mut [f64], all: &[f64], stride: usize| {
            for (own, column) in own.chunks_exact_mut(room).zip(all.chunks_exact(stride)) {
                let each = own[..rows].iter_mut().zip(column);
                each.for_each(|(own, x)| *own = weight * x);
            }
        };
        if let [None, None] = carriers {
            return fill(own, all, stride);
        }
        let inverse = MatRef::from_column_major_slice_with_stride(all, a.len(), b.len(), stride);
        let half = match carriers[1] {
            None => inverse,
            Some(carrier) => {
                self.half.resize(a.len() * columns, 0.0);
                let half = &mut self.half[..];
                let mut half = MatMut::from_column_major_slice_mut(half, a.len(), columns);
                let to = half.as_mut();
                matmul(to, Accum::Replace, inverse, carrier, 1.0);
                half.into_const()
            }
        };
        match carriers[0] {
            Some(carrier) => {
                let own = MatMut::from_column_major_slice_with_stride_mut(own, rows, columns, room);
                let carrier = carrier.transpose();
                matmul(own, Accum::Replace, carrier, half, weight);
            }
            // That of the second is as long as the first's points.
            None => fill(own, &self.half, rows),
        }
    }
}

/// Of N columns of A: adds A y to `seen` and Aᵀ x to `out`, each number being loaded once.
#[inline(always)]
fn both<const N: usize>(a: &[f64], [x, y]: [&[f64]; 2], [seen, out]: [&mut [f64]; 2]) {
    let columns: [&[f64]; N] = std::array::from_fn(|k| &a[k * x.len()..][..x.len()]);
    let mut sums = [[0.0; LANES]; N];
    for (i, (x, seen)) in (x.chunks_exact(LANES).zip(seen.chunks_exact_mut(LANES))).enumerate() {
        let own: [&[f64]; N] = columns.map(|column| &column[LANES * i..][..LANES]);
        for l in 0..LANES {
            let mut sum = seen[l];
            for k in 0..N {
                sums[k][l] += x[l] * own[k][l];
                sum += y[k] * own[k][l];
            }
            seen[l] = sum;
        }
    }
    for (out, sums) in out.iter_mut().zip(&sums) {
        *out += sums.iter().sum::<f64>();
    }
}
