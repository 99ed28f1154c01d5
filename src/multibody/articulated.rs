//! Inertia of a tree of bodies none of which feels another: its product with accelerations or momenta divided by it, each at the cost of one pass over the bodies.
//!
//! M v = τ on the free velocities, driven ones being zero, from the leaves to the roots with articulated inertias I^A and wrenches p^A in the bodies' frames,
//!
//! ```text
//! I^A = I + Σ Xᵀ (I^A − U D⁻¹ Uᵀ) X      U = I^A S      D = Sᵀ U
//! p^A = Σ Xᵀ (p^A + U D⁻¹ u)             u = τ − Sᵀ p^A
//! ```
//!
//! (sums over the children) and back, v = D⁻¹ (u − Uᵀ X a). D is what is left of a joint's own block of M once all joints behind it give way.
//!
//! # References
//! R. Featherstone, "Rigid Body Dynamics Algorithms", 2008, chapter 7.

use super::{Kinematics, Tree};
use crate::adjoint::lie::{Mat6, Pose, Vec6};
use nalgebra::{Cholesky, Const, DMatrix, DVector};
use std::ops::Range;

/// The factored inertia.
pub struct Articulated {
    /// Parents before children.
    links: Vec<Jointed>,
    velocities: usize,
}

/// One body with its joint.
struct Jointed {
    parent: Option<usize>,
    /// Its pose in its parent's frame; of a root in the world's.
    pose: Pose,
    v: Range<usize>,
    /// Which of the joint's velocities are free.
    is_free: [bool; 6],
    /// S, body frame; zeros for driven velocities and where the joint has none.
    columns: Mat6,
    /// U.
    inertia: Mat6,
    /// D, with ones where S is zero.
    factor: Cholesky<f64, Const<6>>,
}

/// An inertia that isn't positive definite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Indefinite {
    /// The body whose joint has none left.
    pub body: usize,
    /// Smallest eigenvalue of what is left, scaled by the joint's own block of M; NaN where it isn't finite.
    pub smallest: f64,
}

impl Articulated {
    /// From the bodies' spatial inertias (body frames, about their origins: kg, kg m, kg m²), and of each velocity that is free what its joint's drive adds to the inertia (kg or
    /// kg m²).
    ///
    /// No joint may follow another.
    ///
    /// # Errors
    /// The first joint (leaves first) of which less than `least` is left.
    pub fn new(
        tree: &Tree,
        kinematics: &Kinematics,
        inertias: &[Mat6],
        added: impl Fn(usize) -> Option<f64>,
        least: f64,
    ) -> Result<Self, Indefinite> {
        // Of the subtrees: with all joints free, and with all of them rigid.
        let (mut articulated, mut composite) = (inertias.to_vec(), inertias.to_vec());
        let mut links = Vec::with_capacity(inertias.len());
        for (body, link) in tree.links().iter().enumerate().rev() {
            let own = &kinematics.poses[body];
            let pose = match link.parent {
                Some(p) => kinematics.poses[p].inverse().compose(own),
                None => *own,
            };
            let mut columns = Mat6::zeros();
            let mut free = [false; 6];
            let mut drive = Mat6::zeros();
            for (k, (column, i)) in link.terms().enumerate() {
                let Some(more) = added(i) else { continue };
                columns.set_column(k, &own.twist_to_body(&kinematics.columns[column]));
                drive[(k, k)] = more;
                free[k] = true;
            }
            let inertia = articulated[body] * columns;
            let mut left = columns.tr_mul(&inertia) + drive;
            let whole = columns.tr_mul(&(composite[body] * columns)) + drive;
            for k in (0..6).filter(|k| !free[*k]) {
                left[(k, k)] = 1.0;
            }
            let factor = factor(&left, &whole, &free, least)
                .map_err(|smallest| Indefinite { body, smallest })?;
            if let Some(p) = link.parent {
                let moved = Mat6::from_columns(&std::array::from_fn::<Vec6, 6, _>(|k| {
                    pose.twist_to_body(&Vec6::ith(k, 1.0))
                }));
                let given = articulated[body] - inertia * factor.solve(&inertia.transpose());
                let given = moved.tr_mul(&(given * moved));
                articulated[p] += 0.5 * (given + given.transpose());
                let rigid = moved.tr_mul(&(composite[body] * moved));
                composite[p] += rigid;
            }
            links.push(Jointed {
                parent: link.parent,
                pose,
                v: link.v.clone(),
                is_free: free,
                columns,
                inertia,
                factor,
            });
        }
        links.reverse();
        Ok(Self {
            links,
            velocities: tree.velocities(),
        })
    }

    /// v with M v = `tau` on the free velocities and zero for driven ones, whose entries of `tau` aren't read.
    pub fn solve(&self, tau: &DVector<f64>) -> DVector<f64> {
        let mut wrenches = vec![Vec6::zeros(); self.links.len()];
        let mut left = vec![Vec6::zeros(); self.links.len()];
        for (b, link) in self.links.iter().enumerate().rev() {
            let mut own = -link.columns.tr_mul(&wrenches[b]);
            for (k, i) in link.v.clone().enumerate().filter(|(k, _)| link.is_free[*k]) {
                own[k] += tau[i];
            }
            if let Some(p) = link.parent {
                let carried = wrenches[b] + link.inertia * link.factor.solve(&own);
                wrenches[p] += link.pose.wrench_to_world(&carried);
            }
            left[b] = own;
        }
        let mut out = DVector::zeros(self.velocities);
        let mut twists: Vec<Vec6> = Vec::with_capacity(self.links.len());
        for (link, own) in self.links.iter().zip(left) {
            let carried =
                (link.parent).map_or(Vec6::zeros(), |p| link.pose.twist_to_body(&twists[p]));
            let rate = link.factor.solve(&(own - link.inertia.tr_mul(&carried)));
            for (k, i) in link.v.clone().enumerate().filter(|(k, _)| link.is_free[*k]) {
                out[i] = rate[k];
            }
            twists.push(carried + link.columns * rate);
        }
        out
    }

    /// The same of every column.
    pub fn solve_columns(&self, tau: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = tau.clone();
        for (mut to, from) in out.column_iter_mut().zip(tau.column_iter()) {
            to.copy_from(&self.solve(&from.into_owned()));
        }
        out
    }
}

/// The factor of what is left of a joint's block, `whole` being the block itself; the smallest eigenvalue of the one scaled by the other's diagonal where it is under
/// `least`.
fn factor(
    left: &Mat6,
    whole: &Mat6,
    is_free: &[bool; 6],
    least: f64,
) -> Result<Cholesky<f64, Const<6>>, f64> {
    let scale: [f64; 6] = std::array::from_fn(|k| match (is_free[k], whole[(k, k)]) {
        (false, _) => 1.0,
        (true, d) if d > 0.0 => 1.0 / d.sqrt(),
        (true, _) => 0.0,
    });
    let scaled = Mat6::from_fn(|i, j| scale[i] * left[(i, j)] * scale[j]);
    let sound = (scaled - least * Mat6::identity()).cholesky().is_some();
    let found = sound.then(|| left.cholesky()).flatten();
    found.ok_or_else(|| match scaled.iter().all(|x| x.is_finite()) {
        true => scaled.symmetric_eigenvalues().min(),
        false => f64::NAN,
    })
}
