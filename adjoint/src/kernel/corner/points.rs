//! Gradients of both layers in the points, in closed form: two terms a panel, which share the distances.

use crate::kernel::Triangles;
use crate::kernel::flux::edge_gradient;
use crate::kernel::lane::{Lane, Lanes, V3, scale, scale_add};
use crate::kernel::panel::constant;
use crate::kernel::sum::{Scratch, TILE, Terms, registers};
use pulp::Simd;

/// The single layer's and the double layer's gradient of each panel in turn.
#[derive(Clone, Copy)]
pub(super) struct Both<'a>(pub &'a Triangles);

impl Terms<3> for Both<'_> {
    fn len(self) -> usize {
        2 * self.0.len()
    }

    #[inline(always)]
    fn evaluate<S: Simd>(
        self,
        _: S,
        tile: usize,
        s: V3<Lanes<S>>,
        _: V3<Lanes<S>>,
        _: &mut Scratch<S>,
        out: &mut [[S::f64s; 3]; TILE],
    ) {
        let panels = &self.0.panels[tile * TILE / 2..];
        for (out, panel) in out.chunks_exact_mut(2).zip(panels) {
            let (r, l) = panel.seen(s);
            let x = l[0];
            let normal = constant(x, &panel.normal);
            let mut single = scale(panel.angle(r[0], l), normal);
            let mut double = [x.like(0.0); 3];
            for e in 0..3 {
                let outward = constant(x, &panel.outward[e]);
                single = scale_add(-panel.logarithm(e, l), outward, single);
                let along = constant(x, &panel.along[e]);
                let squared = x.like(2.0 * panel.half_squares[e]);
                let term = edge_gradient(r[e], along, squared, l[e], l[(e + 1) % 3]);
                double = scale_add(x.like(panel.weight), term, double);
            }
            out[0] = registers(single);
            out[1] = registers(double);
        }
    }
}

/// Numbers of the single and the double layer of each panel in turn.
pub(super) fn in_turn(single: &[f64], double: &[f64], columns: usize) -> Vec<f64> {
    let rows = single.chunks(columns).zip(double.chunks(columns));
    rows.flat_map(|(s, d)| s.iter().chain(d)).copied().collect()
}
