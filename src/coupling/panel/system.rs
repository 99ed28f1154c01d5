//! The matrix between panels at given poses, and its solves.

use super::PanelModel;
use super::sweep::{Block, sweep};
use crate::adjoint::kernel::{Sources, Write, double_fill};
use crate::adjoint::lie::{Pose, Vec3};
use crate::adjoint::solve::Columnwise;
use crate::coupling::Reached;
use crate::coupling::film::PlacedFilms;
use crate::coupling::full::FullSolver;
use crate::coupling::pair::Pair;
use crate::coupling::settings::converged;
use crate::geometry::Image;
use crate::solver::{Columns, Lu, gmres};
use crate::{Error, Result};
use rayon::prelude::*;

/// GMRES iterations before a restart.
const RESTART: usize = 100;
/// Share of the full solid angle that a body may fill, seen from a panel of another: 0 outside, ½ on
/// its surface, 1 inside.
const INSIDE: f64 = 0.25;
/// Panels whose solid angles are added up by one task.
const GROUP: usize = 128;

/// The bodies at given poses.
#[derive(Clone, Copy)]
struct Placed<'a> {
    coupled: &'a PanelModel,
    poses: &'a [Pose],
    films: &'a PlacedFilms,
}

/// A = ½I + Ω/4π at given poses.
pub(super) struct System<'a> {
    coupled: &'a PanelModel,
    matrix: Matrix,
}

enum Matrix {
    /// All but each body's own block, whose inverse is known.
    Blocks(Vec<Block>),
    Factored(Lu),
}

impl Drop for System<'_> {
    fn drop(&mut self) {
        if let (Matrix::Blocks(blocks), Ok(mut spare)) =
            (&mut self.matrix, self.coupled.spare.lock())
        {
            spare.extend(blocks.drain(..).map(|block| block.data));
        }
    }
}

impl<'a> System<'a> {
    /// Assembles A, and factors it where the solver is [`FullSolver::Qr`].
    ///
    /// # Errors
    /// Bodies inside each other, or behind a wall.
    pub fn new(coupled: &'a PanelModel, poses: &[Pose], films: &PlacedFilms) -> Result<Self> {
        let placed = Placed {
            coupled,
            poses,
            films,
        };
        coupled.check_walls(poses)?;
        let matrix = match coupled.settings.solver {
            FullSolver::Qr => Matrix::Factored(placed.dense()?),
            FullSolver::Cgls | FullSolver::Gmres => Matrix::Blocks(placed.blocks()?),
        };
        Ok(Self { coupled, matrix })
    }

    /// Condition number of a dense matrix; 0 for blocks.
    pub fn condition(&self) -> f64 {
        match &self.matrix {
            Matrix::Blocks(_) => 0.0,
            Matrix::Factored(lu) => lu.condition(),
        }
    }

    /// x and y of `A x = right` and `Aᵀ y = turned`, together, so that each block is read once for both.
    ///
    /// # Errors
    /// A solve that misses its tolerance.
    pub fn solve(&self, right: &Columns, turned: &Columns) -> Result<([Columns; 2], Reached)> {
        let (settings, rows) = (&self.coupled.settings, self.coupled.rows());
        let blocks = match &self.matrix {
            Matrix::Factored(lu) => {
                let (mut x, mut y) = (right.clone(), turned.clone());
                lu.solve(x.as_mat_mut());
                lu.solve_transpose(y.as_mat_mut());
                return Ok(([x, y], Reached::default()));
            }
            Matrix::Blocks(blocks) => blocks,
        };
        let outcome = gmres(
            |v, columns| {
                let straight = columns.partition_point(|k| *k < right.columns);
                sweep(self.coupled, blocks, v, straight)
            },
            &right.beside(turned),
            settings.tolerance,
            settings.max_iterations,
            RESTART,
        );
        let what = || format!("the coupled panel system ({rows} panels)");
        let outcome = converged(outcome, settings.tolerance, what, "solver lu")?;
        let (x, y) = outcome.x.split(right.columns);
        let reached = Reached {
            iterations: outcome.iterations,
            residual: outcome.residual,
        };
        Ok(([x, y], reached))
    }
}

impl Placed<'_> {
    /// Centroids of body `target` in the frame of body `source`, mirrored, as far off as they are held.
    pub fn seen_from(&self, image: &Image, source: usize, target: usize) -> Sources {
        let centres = &self.coupled.bodies[target].faces.centres;
        let at = |b: usize| (b, &self.poses[b]);
        Pair::new(at(source), at(target), image, centres)
            .held_off(self.films)
            .points
    }

    /// Images of body `source` that body `target` feels; of its own all but itself.
    fn images(&self, source: usize, target: usize) -> impl Iterator<Item = &Image> {
        let apart = source == target || self.coupled.excluded.contains(source, target);
        let images = self.coupled.images.iter();
        images.filter(move |image| !(apart && image.is_identity()))
    }

    /// So many numbers, of any values.
    fn memory(&self, length: usize) -> Vec<f64> {
        let used = self.coupled.spare.lock().ok().and_then(|mut spare| {
            let at = spare.iter().position(|data| data.len() == length)?;
            Some(spare.swap_remove(at))
        });
        used.unwrap_or_else(|| vec![0.0; length])
    }

    /// Blocks of A between different bodies, and those that images make.
    fn blocks(&self) -> Result<Vec<Block>> {
        let coupled = self.coupled;
        let count = coupled.bodies.len();
        let mut out = Vec::new();
        for source in 0..count {
            for target in 0..count {
                if !self.images(source, target).any(|_| true) {
                    continue;
                }
                let columns = coupled.faces[target].len();
                let mut data = self.memory(coupled.faces[source].len() * columns);
                self.fill(source, target, &mut data, columns, 0)?;
                out.push(Block {
                    source,
                    target,
                    data,
                });
            }
        }
        Ok(out)
    }

    /// All of A, factored.
    fn dense(&self) -> Result<Lu> {
        let coupled = self.coupled;
        let n = coupled.rows();
        // By panels and points: A by columns.
        let mut matrix = vec![0.0; n * n];
        for (source, panels) in coupled.faces.iter().enumerate() {
            let out = &mut matrix[panels.start * n..panels.end * n];
            for (target, points) in coupled.faces.iter().enumerate() {
                self.fill(source, target, out, n, points.start)?;
            }
            // Together with the blocks of images, so added to what is there.
            let body = &coupled.bodies[source];
            let centres = &body.faces.centres;
            let layers = body.panels();
            let image_diagonal: Vec<f64> = (0..panels.len())
                .map(|i| out[i * n + panels.start + i])
                .collect();
            layers.double_layer(centres, Write::Add, out, n, panels.start);
            for (i, d) in image_diagonal.iter().enumerate() {
                out[i * n + panels.start + i] = 0.5 + d;
            }
        }
        Ok(Lu::new(matrix, n))
    }

    /// Writes Ω/4π of a body's panels and of their images at the panels of another (only of the images at
    /// its own), into `out[panel · stride + column + point]`.
    fn fill(
        &self,
        source: usize,
        target: usize,
        out: &mut [f64],
        stride: usize,
        column: usize,
    ) -> Result<()> {
        let coupled = self.coupled;
        let triangles = coupled.bodies[source].panels().triangles();
        let points = coupled.faces[target].len();
        for (n, image) in self.images(source, target).enumerate() {
            let seen = self.seen_from(image, source, target);
            // Images in free surfaces have the opposite sign, and the kernel only adds.
            let signed = |out: &mut [f64]| {
                if image.sign > 0.0 {
                    return;
                }
                for row in out.chunks_mut(stride) {
                    let row = &mut row[column..column + points];
                    row.iter_mut().for_each(|x| *x *= image.sign);
                }
            };
            let write = match n {
                0 => Write::Set,
                _ => Write::Add,
            };
            if write == Write::Add {
                signed(out);
            }
            double_fill(triangles, &seen, write, out, stride, column);
            signed(out);
        }
        let sums = out.par_chunks(stride * GROUP).map(|rows| {
            let mut sum = vec![0.0; points];
            for row in rows.chunks(stride) {
                let row = sum.iter_mut().zip(&row[column..column + points]);
                row.for_each(|(s, x)| *s += x);
            }
            sum
        });
        let mut filled = vec![0.0; points];
        for sum in sums.collect::<Vec<_>>() {
            filled.iter_mut().zip(sum).for_each(|(f, s)| *f += s);
        }
        // Also where it isn't a number.
        match filled.iter().position(|f| f.is_nan() || f.abs() >= INSIDE) {
            None => Ok(()),
            Some(i) => Err(self.overlap(source, target, i, filled[i])),
        }
    }

    fn overlap(&self, source: usize, target: usize, face: usize, filled: f64) -> Error {
        let coupled = self.coupled;
        let [a, b] = [target, source].map(|body| &coupled.names[body]);
        let x = self.poses[target].apply(&coupled.bodies[target].faces.centres[face]);
        let (place, quantity, remedy) = if source == target {
            (
                format!("body \"{a}\" and its mirror image"),
                "its image",
                "it reaches through a wall: move it into the fluid",
            )
        } else {
            (
                format!("body \"{a}\" and body \"{b}\""),
                "the second",
                "they overlap: move them apart",
            )
        };
        Error::Unresolved {
            place,
            quantity: format!(
                "share of the solid angle that {quantity} fills, seen from face {face} of the first at \
             {:?}",
                x.as_slice()
            ),
            value: filled,
            limit: INSIDE,
            remedy: remedy.into(),
        }
    }
}

impl PanelModel {
    /// Every body must be on the fluid's side of every wall.
    ///
    /// # Errors
    /// One that isn't.
    pub(super) fn check_walls(&self, poses: &[Pose]) -> Result<()> {
        for ((body, name), pose) in self.bodies.iter().zip(&self.names).zip(poses) {
            for (w, wall) in self.walls.iter().enumerate() {
                let corners = body.faces.corners.iter().flatten();
                let height = |c: &Vec3| wall.height(&pose.apply(c));
                let lowest = corners.map(height).fold(f64::INFINITY, f64::min);
                if lowest < 0.0 {
                    return Err(Error::Unresolved {
                        place: format!("body \"{name}\" and wall {w}"),
                        quantity: "gap in m".into(),
                        value: lowest,
                        limit: 0.0,
                        remedy: format!(
                            "it reaches through the wall: move it into the fluid by at least {:.6e} m",
                            -lowest
                        ),
                    });
                }
            }
        }
        Ok(())
    }

    /// Refuses bodies inside each other, from the share of the full solid angle that all others and all images fill, seen from every
    /// panel. Where one is large the shares of single bodies tell which.
    ///
    /// # Errors
    /// Bodies inside each other, or behind a wall.
    pub fn check_filled(&self, poses: &[Pose], filled: &[f64]) -> Result<()> {
        // What isn't a number isn't small either.
        match filled.iter().all(|f| f.abs() < INSIDE) {
            true => Ok(()),
            false => self.check_apart(poses),
        }
    }

    /// The same from the shares of single bodies.
    ///
    /// # Errors
    /// As there.
    pub fn check_apart(&self, poses: &[Pose]) -> Result<()> {
        let coupled = self;
        let films = &PlacedFilms::default();
        let placed = Placed {
            coupled,
            poses,
            films,
        };
        placed.blocks().map(|_| ())
    }
}
