//! How the added mass changes with the shape by Hadamard's formula: of the continuous problem, from the flow on the surface.
//!
//! For a surface that moves by δn along its normal into the fluid, with the velocities u_i = −∇φ_i of the water and U_i of the body that belong to unit twists,
//!
//! ```text
//! δM_ij = ∮ (u_i·u_j − U_i·u_j − U_j·u_i) δn dA,        u = q n − ∇_s φ
//! ```
//!
//! No further solve is needed. A discrete M has its own derivative ([`PanelBoundary::added_mass_slopes`]), which differs by the error of discretisation.
//!
//! # References
//! J. Hadamard, "Mémoire sur le problème d'analyse relatif à l'équilibre des plaques élastiques encastrées", Mém. Sav. Étrang. 33 (1908).

use super::PanelBoundary;
use crate::adjoint::lie::{Mat6, Vec3, Vec6, point_velocity};

impl PanelBoundary {
    /// Rate of the added mass at unit density while the vertices move with these velocities (m/s, body frame) by Hadamard's formula, panels as points: kg/s, kg·m/s,
    /// kg·m²/s, body frame, about its origin.
    ///
    /// Panics unless there is a velocity for each vertex.
    pub fn added_mass_along_by_flow(&self, velocities: &[Vec3]) -> Mat6 {
        assert_eq!(
            velocities.len(),
            self.panels.vertices().len(),
            "one a vertex"
        );
        let faces = &self.faces;
        let unit = |k: usize| Vec6::from_fn(|c, _| f64::from(c == k));
        let flows: Vec<Vec<Vec3>> = (0..6)
            .map(|k| {
                let (q, phi) = (
                    self.own_normal_velocity(&unit(k)),
                    self.own_potential(&unit(k)),
                );
                let along = self.surface_gradient(&phi);
                let parts = q.iter().zip(&along).zip(&faces.normals);
                parts.map(|((q, along), n)| *q * n - along).collect()
            })
            .collect();
        let mut out = Mat6::zeros();
        let mut add = |face: usize, part: &dyn Fn(usize, usize) -> f64| {
            let corners = self.panels.corners()[face].map(|v| velocities[v as usize]);
            let moved = faces.normals[face].dot(&(corners[0] + corners[1] + corners[2])) / 3.0;
            out += faces.areas[face] * moved * Mat6::from_fn(part);
        };
        for (face, centre) in faces.centres.iter().enumerate() {
            let own = [0, 1, 2, 3, 4, 5].map(|k| point_velocity(&unit(k), centre));
            add(face, &|i, j| {
                let (u, v) = (&flows[i][face], &flows[j][face]);
                u.dot(v) - own[i].dot(v) - own[j].dot(u)
            });
        }
        // Products of velocities without bound at sharp edges are larger than those of their means.
        for (face, across, more) in self.steep() {
            add(*face, &|i, j| {
                more * flows[i][*face].dot(across) * flows[j][*face].dot(across)
            });
        }
        out
    }
}
