//! Normal velocity: value.

use crate::kernel::lane::{Lane, V3, dot, sub};
use crate::kernel::sum::{TILE, dispatch, fill, load, put, splat};
use crate::kernel::{Points, Sources, Write};
use crate::lie::Vec3;
use pulp::{Simd, WithSimd};

/// `n·r/|r|³`; `n` may carry the row weight.
#[inline(always)]
pub(in crate::kernel) fn velocity<T: Lane>(n: V3<T>, r: V3<T>) -> T {
    let r2 = dot(r, r);
    dot(n, r) / (r2 * r2.sqrt())
}

/// `weight n·(x − s)/|x − s|³`.
pub fn normal(x: &Vec3, n: &Vec3, weight: f64, s: &Vec3) -> f64 {
    weight * velocity((*n).into(), (x - s).into())
}

/// `K_ij` into `out[i · stride + column + j]`, targets × sources.
pub fn normal_fill(
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
            let normal = splat(simd, &self.targets.weighted[self.first + i]);
            for v in 0..count.div_ceil(S::F64_LANES) {
                let value = velocity(normal, sub(centre, load(simd, self.sources, v)));
                let j = v * S::F64_LANES;
                let end = count.min(j + S::F64_LANES);
                let out = &mut row[self.column + j..self.column + end];
                put(simd, self.add, value.v, out);
            }
        }
    }
}
