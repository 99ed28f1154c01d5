//! Flux of a point source through flat triangles, as their double layer: [`flux`](mod@super::flux) near a triangle, two terms of
//! its multipole series far from it, blended smoothly (`kernel::panel`).
//!
//! Where all is near, `flux` is the cheaper one: its sums go over edges, each of which serves two triangles.

use super::flux::edge_gradient;
use super::lane::{Lane, Lanes, V3, dot, scale, scale_add};
use super::layer::{Gradients, Tangents};
use super::panel::{Layer, Multipoles, Panel, constant};
use super::sum::{dispatch, fill, forward, load, put, transposed};
use super::target::FACES;
use super::{Sources, Triangles, Write};
use crate::kernel::flux::edge_gradient_tangent;
use crate::lie::Vec3;
use pulp::{Simd, WithSimd};

/// The double layer.
#[derive(Clone, Copy)]
pub(super) struct Double;

impl Layer for Double {
    #[inline(always)]
    fn near<T: Lane>(panel: &Panel, s: V3<T>) -> T {
        let (r, l) = panel.seen(s);
        l[0].like(panel.weight) * panel.angle(r[0], l)
    }

    #[inline(always)]
    fn near_gradient<T: Lane>(panel: &Panel, s: V3<T>) -> V3<T> {
        let (r, l) = panel.seen(s);
        let mut out = [l[0].like(0.0); 3];
        for c in 0..3 {
            let (along, squared) = edge(panel, c, l[0]);
            let term = edge_gradient(r[c], along, squared, l[c], l[(c + 1) % 3]);
            out = scale_add(l[0].like(panel.weight), term, out);
        }
        out
    }

    #[inline(always)]
    fn near_hessian_product<T: Lane>(panel: &Panel, s: V3<T>, d: V3<T>) -> V3<T> {
        let (r, l) = panel.seen(s);
        let slope = |c: usize| -(dot(r[c], d) / l[c]);
        let dl = [slope(0), slope(1), slope(2)];
        let mut out = [l[0].like(0.0); 3];
        for c in 0..3 {
            let next = (c + 1) % 3;
            let (along, squared) = edge(panel, c, l[0]);
            let (l, dl) = ([l[c], l[next]], [dl[c], dl[next]]);
            let term = edge_gradient_tangent(r[c], along, squared, l, d, dl);
            out = scale_add(l[0].like(panel.weight), term, out);
        }
        out
    }

    #[inline(always)]
    fn far<T: Lane>(panel: &Panel, far: &Multipoles<T>) -> T {
        panel.height(far) * far.alpha()
    }

    #[inline(always)]
    fn far_gradient<T: Lane>(panel: &Panel, far: &Multipoles<T>) -> V3<T> {
        let out = scale(panel.height(far), far.alpha_gradient());
        scale_add(far.alpha(), panel.moment(far), out)
    }

    #[inline(always)]
    fn far_hessian_product<T: Lane>(panel: &Panel, far: &Multipoles<T>, d: V3<T>) -> V3<T> {
        let (slope, moment) = (far.alpha_gradient(), panel.moment(far));
        let mut out = scale(panel.height(far), far.alpha_hessian_product(d));
        out = scale_add(dot(moment, d), slope, out);
        scale_add(dot(slope, d), moment, out)
    }
}

/// Edge `c` and its square, as lanes.
#[inline(always)]
fn edge<T: Lane>(panel: &Panel, c: usize, x: T) -> (V3<T>, T) {
    (
        constant(x, &panel.along[c]),
        x.like(2.0 * panel.half_squares[c]),
    )
}

/// `K_ij` into `out[i · stride + column + j]`, targets × sources.
pub fn double_fill(
    targets: &Triangles,
    sources: &Sources,
    write: Write,
    out: &mut [f64],
    stride: usize,
    column: usize,
) {
    let rows = |tile: usize, out: &mut [f64]| {
        dispatch(Fill {
            panels: &targets.panels[tile * FACES..],
            sources,
            add: write == Write::Add,
            out,
            stride,
            column,
        });
    };
    fill(targets.len(), sources, out, stride, column, FACES, rows);
}

/// Rows of one tile.
struct Fill<'a> {
    panels: &'a [Panel],
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
        for (panel, row) in self.panels.iter().zip(self.out.chunks_mut(self.stride)) {
            for v in 0..count.div_ceil(S::F64_LANES) {
                let s: V3<Lanes<S>> = load(simd, self.sources, v);
                let value = panel.value::<Double, _>(s);
                let j = v * S::F64_LANES;
                let end = count.min(j + S::F64_LANES);
                put(
                    simd,
                    self.add,
                    value.v,
                    &mut row[self.column + j..self.column + end],
                );
            }
        }
    }
}

/// `out[i][k] += Σ_j (∇K_ij · d_j) a[j][k]`; `a` is `[source][k]`, `out` is `[target][k]`.
pub fn double_jvp(
    targets: &Triangles,
    sources: &Sources,
    d: &[Vec3],
    a: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    forward(Gradients(targets, Double), sources, d, a, columns, out);
}

/// `out[j][k] += Σ_i bar[i][k] ∇K_ij`; `bar` is `[target][k]`, `out` is `[source][k][3]`.
pub fn double_vjp(
    targets: &Triangles,
    sources: &Sources,
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    transposed(Gradients(targets, Double), sources, None, bar, columns, out);
}

/// `out[j][k] += Σ_i bar[i][k] ∇∇K_ij d_j`; `bar` is `[target][k]`, `out` is `[source][k][3]`.
pub fn double_hvp(
    targets: &Triangles,
    sources: &Sources,
    d: &[Vec3],
    bar: &[f64],
    columns: usize,
    out: &mut [f64],
) {
    transposed(
        Tangents(targets, Double),
        sources,
        Some(d),
        bar,
        columns,
        out,
    );
}
