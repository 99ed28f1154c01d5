//! Potential: value.

use crate::kernel::lane::{Lane, Lanes, V3, sub};
use crate::kernel::sum::{
    Scratch, TILE, Terms, dispatch, fill, length, load, put, splat, transposed,
};
use crate::kernel::{Points, Sources, Write};
use crate::lie::Vec3;
use pulp::{Simd, WithSimd};

/// `1/|r|`.
#[inline(always)]
pub(in crate::kernel) fn inverse_distance<T: Lane>(r: V3<T>) -> T {
    r[0].like(1.0) / length(r)
}

/// `1/|x − s|`.
pub fn potential(x: &Vec3, s: &Vec3) -> f64 {
    inverse_distance((x - s).into())
}

/// `out[j][k] += Σ_i bar[i][k]/|x_i − s_j|`; `bar` is `[target][k]`, `out` is `[source][k]`.
pub fn potential_sum(
    targets: &Points,
    sources: &Sources,
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    transposed(Values(targets), sources, None, bar, columns, out);
}

/// Inverse distances of the points of a surface.
#[derive(Clone, Copy)]
struct Values<'a>(&'a Points);

impl Terms<1> for Values<'_> {
    fn len(self) -> usize {
        self.0.len()
    }

    #[inline(always)]
    fn evaluate<S: Simd>(
        self,
        simd: S,
        tile: usize,
        s: V3<Lanes<S>>,
        _: V3<Lanes<S>>,
        _: &mut Scratch<S>,
        out: &mut [[S::f64s; 1]; TILE],
    ) {
        let first = tile * TILE;
        let centres = &self.0.centre[first..];
        for (out, centre) in out.iter_mut().zip(centres) {
            let r = sub(splat(simd, centre), s);
            *out = [inverse_distance(r).v];
        }
    }
}

/// `P_ij` into `out[i · stride + column + j]`, targets × sources.
pub fn potential_fill(
    targets: &Points,
    sources: &Sources,
    write: Write,
    out: &mut [f64],
    stride: usize,
    column: usize,
) {
    fill(
        targets.len(),
        sources,
        out,
        stride,
        column,
        TILE,
        |tile, out| {
            dispatch(Fill {
                targets,
                first: tile * TILE,
                sources,
                add: write == Write::Add,
                out,
                stride,
                column,
            });
        },
    );
}

/// Some rows.
struct Fill<'a> {
    targets: &'a Points,
    first: usize,
    sources: &'a Sources,
    add: bool,
    out: &'a mut [f64],
    stride: usize,
    column: usize,
}

impl WithSimd for Fill<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let count = self.sources.len();
        for (i, row) in self.out.chunks_mut(self.stride).enumerate() {
            let centre = splat(simd, &self.targets.centre[self.first + i]);
            for v in 0..count.div_ceil(S::F64_LANES) {
                let value = inverse_distance(sub(centre, load(simd, self.sources, v)));
                let j = v * S::F64_LANES;
                let end = count.min(j + S::F64_LANES);
                let out = &mut row[self.column + j..self.column + end];
                put(simd, self.add, value.v, out);
            }
        }
    }
}
