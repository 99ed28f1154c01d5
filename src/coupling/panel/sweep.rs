//! One step of the iteration: the preconditioner and the matrix, and the same of the transpose.
//!
//! With D the bodies' own blocks, L those by which they act on later ones, and U those by which they act on earlier ones, or on themselves
//! by images, the preconditioner is block Gauss–Seidel, which uses each block once:
//!
//! ```text
//! z = (D + L)⁻¹ v,   A z = v + U z,        y = (D + L)⁻ᵀ w,   Aᵀ y = w + Uᵀ y
//! ```
//!
//! z goes from the first body to the last and y from the last to the first. A block needs z of the body that acts and y of the one acted
//! on; where both are known before either product is needed, which is so for two blocks of three or more, it is read once for both.

use super::PanelModel;
use crate::adjoint::solve::Columnwise;
use crate::solver::{Columns, both_products};

/// Layers of one body at the panels of another, or of its images at its own.
pub(super) struct Block {
    pub source: usize,
    pub target: usize,
    /// Ω/4π, `[panel of source][panel of target]`.
    pub data: Vec<f64>,
}

/// Columns of A, or of Aᵀ.
struct Side {
    /// Right-hand sides until their body's turn comes, then z.
    z: Columns,
    image: Columns,
}

impl Side {
    fn new(v: Columns) -> Self {
        Self {
            z: v.clone(),
            image: v,
        }
    }

    /// Solves the own block of body `b`.
    fn solve(&mut self, coupled: &PanelModel, b: usize, transpose: bool) {
        let rows = &coupled.faces[b];
        let z = coupled.bodies[b].solve(&self.z.part(rows), transpose);
        self.z.slice_mut(rows).copy_from_slice(&z.data);
    }
}

/// `[z, A z]` of the first columns of v, as many as `straight`, and `[y, Aᵀ y]` of the others.
pub(super) fn sweep(
    coupled: &PanelModel,
    blocks: &[Block],
    v: &Columns,
    straight: usize,
) -> [Columns; 2] {
    let (v, w) = v.split(straight);
    let mut sides = [Side::new(v), Side::new(w)];
    let last = coupled.bodies.len().saturating_sub(1);
    for step in 0..coupled.bodies.len() {
        let (first, end) = (step, last - step);
        sides[0].solve(coupled, first, false);
        sides[1].solve(coupled, end, true);
        for block in blocks.iter().filter(|b| b.source < b.target) {
            let (from, to) = (block.source, block.target);
            let used = if 2 * from < last && last < 2 * to {
                [step == from.max(last - to); 2]
            } else {
                [first == from, end == to]
            };
            apply(coupled, block, used, &mut sides);
        }
    }
    for block in blocks.iter().filter(|b| b.source >= b.target) {
        apply(coupled, block, [true; 2], &mut sides);
    }
    let [a, b] = sides;
    [a.z.beside(&b.z), a.image.beside(&b.image)]
}

/// What a block makes of z, and its transpose of y, where they are used: off right-hand sides that are still to be solved, or onto images.
fn apply(coupled: &PanelModel, block: &Block, used: [bool; 2], sides: &mut [Side; 2]) {
    let (panels, points) = (&coupled.faces[block.source], &coupled.faces[block.target]);
    let known = |side: usize, rows| match used[side] {
        true => sides[side].z.part(rows),
        false => Columns::zeros(rows.len(), 0),
    };
    let (y, x) = (known(0, panels), known(1, points));
    if x.columns + y.columns == 0 {
        return;
    }
    // Panels are rows of the data, but columns of A.
    let [turned, straight] = both_products(&block.data, panels.len(), &x, &y);
    let made = [(straight, points), (turned, panels)];
    for ((made, rows), side) in made.iter().zip(sides) {
        if made.columns == 0 {
            continue;
        }
        let (out, sign) = match block.source < block.target {
            true => (&mut side.z, -1.0),
            false => (&mut side.image, 1.0),
        };
        let out = out.slice_mut(rows).iter_mut();
        out.zip(&made.data).for_each(|(o, m)| *o += sign * m);
    }
}
