//! Sums over the panels of a surface: any of its [layers](super::panel).

use super::Triangles;
use super::lane::{Lanes, V3};
use super::panel::Layer;
use super::sum::{Scratch, TILE, Terms};
use pulp::Simd;

/// Values of a surface's panels.
#[derive(Clone, Copy)]
pub(super) struct Values<'a, L>(pub &'a Triangles, pub L);

/// Gradients of a surface's panels.
#[derive(Clone, Copy)]
pub(super) struct Gradients<'a, L>(pub &'a Triangles, pub L);

/// Tangents of a surface's gradients.
#[derive(Clone, Copy)]
pub(super) struct Tangents<'a, L>(pub &'a Triangles, pub L);

macro_rules! terms {
    ($type:ident, $components:literal, |$panel:ident, $s:ident, $d:ident| $value:expr) => {
        impl<L: Layer> Terms<$components> for $type<'_, L> {
            fn len(self) -> usize {
                self.0.len()
            }

            #[inline(always)]
            fn evaluate<S: Simd>(
                self,
                _: S,
                tile: usize,
                $s: V3<Lanes<S>>,
                $d: V3<Lanes<S>>,
                _: &mut Scratch<S>,
                out: &mut [[S::f64s; $components]; TILE],
            ) {
                for (out, $panel) in out.iter_mut().zip(&self.0.panels[tile * TILE..]) {
                    let value: [Lanes<S>; $components] = $value;
                    for (out, value) in out.iter_mut().zip(&value) {
                        *out = value.v;
                    }
                }
            }
        }
    };
}

terms!(Values, 1, |panel, s, _d| [panel.value::<L, _>(s)]);
terms!(Gradients, 3, |panel, s, _d| panel.gradient::<L, _>(s));
terms!(Tangents, 3, |panel, s, d| panel
    .hessian_product::<L, _>(s, d));
