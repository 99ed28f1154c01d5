//! Flux: value.

use super::constant;
use crate::kernel::lane::{Lane, Lanes, V3, dot, sub};
use crate::kernel::sum::{Aligned, dispatch, fill, length, load, put, splat};
use crate::kernel::target::{FACES, Face, Tile};
use crate::kernel::{Sources, Triangles, Write};
use crate::lie::Vec3;
use pulp::{Simd, WithSimd};

/// Solid angle Ω from `2A n`, the corner `r_0 = v_0 − s`, the lengths `l_c` and the halved squares
/// of the edges 01, 12, 20.
#[inline(always)]
pub(in crate::kernel) fn solid_angle<T: Lane>(
    double_area: V3<T>,
    r0: V3<T>,
    l: V3<T>,
    half_e2: V3<T>,
) -> T {
    let half = l[0].like(0.5);
    let [h0, h1, h2] = [half * l[0] * l[0], half * l[1] * l[1], half * l[2] * l[2]];
    // r·r' = ½(l² + l'² − e²)
    let d01 = h0 + (h1 - half_e2[0]);
    let d12 = h1 + (h2 - half_e2[1]);
    let d20 = h2 + (h0 - half_e2[2]);
    let n = dot(double_area, r0);
    let d = (l[0].mul_add(l[1], d01)).mul_add(l[2], d12.mul_add(l[0], d20 * l[1]));
    let half_angle = n.atan2(d);
    half_angle + half_angle
}

/// Ω of the triangle with these corners.
pub(in crate::kernel) fn solid_angle_of<T: Lane>(corners: &[Vec3; 3], s: V3<T>) -> T {
    let [a, b, c] = corners;
    let r = corners.map(|v| sub(constant(s[0], &v), s));
    let l = r.map(|r| dot(r, r).sqrt());
    let half_e2 = [b - a, c - b, a - c].map(|e| s[0].like(0.5 * e.norm_squared()));
    let double_area = constant(s[0], &(b - a).cross(&(c - a)));
    solid_angle(double_area, r[0], l, half_e2)
}

/// `weight · Ω`: flux of a unit source at `s` through the triangle, along its normal.
pub fn flux(corners: &[Vec3; 3], weight: f64, s: &Vec3) -> f64 {
    weight * solid_angle_of(corners, [s.x, s.y, s.z])
}

/// `K_ij` into `out[i · stride + column + j]`, targets × sources.
pub fn flux_fill(
    targets: &Triangles,
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
        FACES,
        |tile, out| {
            dispatch(Fill {
                tile: &targets.faces[tile],
                sources,
                add: write == Write::Add,
                out,
                stride,
                column,
            });
        },
    );
}

/// Vectors of sources for which the distances of a tile's vertices are kept.
const GROUP: usize = 4;

/// Rows of one tile.
struct Fill<'a> {
    tile: &'a Tile<Face>,
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
        let zero = simd.splat_f64s(0.0);
        let mut lengths = Aligned([[zero; GROUP]; 3 * FACES]);
        let count = self.sources.len();
        let vectors = count.div_ceil(S::F64_LANES);
        let mut first = 0;
        while first < vectors {
            let group = GROUP.min(vectors - first);
            let mut s = [[Lanes::new(simd, zero); 3]; GROUP];
            for (v, s) in s[..group].iter_mut().enumerate() {
                *s = load(simd, self.sources, first + v);
            }
            for (lengths, vertex) in lengths.0.iter_mut().zip(&self.tile.vertices) {
                let vertex = splat(simd, vertex);
                for (length_v, s) in lengths[..group].iter_mut().zip(&s) {
                    *length_v = length(sub(vertex, *s)).v;
                }
            }
            for (face, row) in self.tile.items.iter().zip(self.out.chunks_mut(self.stride)) {
                let [a, b, c] = face.corners.map(|c| c as usize);
                let (a, b, c) = (&lengths.0[a], &lengths.0[b], &lengths.0[c]);
                let corner = splat(simd, &face.first);
                let double_area = splat(simd, &face.double_area);
                let half_e2 = splat(simd, &face.half_squares);
                let weight = Lanes::splat(simd, face.weight);
                for v in 0..group {
                    let l = [
                        Lanes::new(simd, a[v]),
                        Lanes::new(simd, b[v]),
                        Lanes::new(simd, c[v]),
                    ];
                    let value = weight * solid_angle(double_area, sub(corner, s[v]), l, half_e2);
                    let j = (first + v) * S::F64_LANES;
                    let end = count.min(j + S::F64_LANES);
                    let out = &mut row[self.column + j..self.column + end];
                    put(simd, self.add, value.v, out);
                }
            }
            first += group;
        }
    }
}
