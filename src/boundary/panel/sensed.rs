//! The flow of panels at points in the water, with its transposes: what sensors there read.
//!
//! With the body's own normal velocities q = F x̄ (or their rates) and the potentials φ of its panels, in the body's frame,
//!
//! ```text
//! φ(x) = Σ_j S_j q_j − Ω_j/4π φ_j,     u(x) = Σ_j { γ_j × ∇I_j − q_j ∇I_j } / 4π,     γ = n × ∇_s φ
//! Σ ū·u = Σ_j γ_j·(∇I_j × ū) − q_j ∇I_j·ū        a derivative of single layers along ū and along ū × e_c
//! ```
//!
//! so that the gradient of a velocity is a product with the Hessian of single layers. Potentials are by the kernels that have derivatives, in which panels far off are
//! multipoles; those of [`PanelBoundary::layers`] differ by that.

use super::PanelBoundary;
use super::sheet::sheet_bar;
use crate::adjoint::kernel::{
    Sources, Write, double_fill, double_vjp, single_hvp, single_jvp, single_sum, single_vjp,
};
use crate::adjoint::lie::{Vec3, Vec6};

/// Points whose solid angles are kept at a time.
const BLOCK: usize = 64;

/// The gradient in what the flow at points follows from, body frame.
#[derive(Clone, Debug)]
pub(crate) struct SensedBar {
    /// Of the body's twist, or its rate.
    pub twist: Vec6,
    /// Of the potentials of the panels.
    pub phi: Vec<f64>,
    /// Of the points.
    pub points: Vec<Vec3>,
}

impl PanelBoundary {
    /// Normal velocities per unit twist, `[panel][6]`.
    fn six_velocities(&self) -> Vec<f64> {
        let q = &self.normal_velocity;
        (0..6 * q.nrows()).map(|n| q[(n / 6, n % 6)]).collect()
    }

    /// Potential at points outside (body frame, m) for a twist of the body and potentials of the panels, m²/s.
    pub(crate) fn potential_at(&self, twist: &Vec6, phi: &[f64], points: &[Vec3]) -> Vec<f64> {
        let triangles = self.panels.triangles();
        let mut out = vec![0.0; points.len()];
        let q = self.own_normal_velocity(twist);
        single_sum(triangles, &Sources::new(points), &q, 1, &mut out);
        self.solid_angles(points, |i, angles| {
            out[i] -= angles.zip(phi).map(|(angle, phi)| angle * phi).sum::<f64>();
        });
        out
    }

    /// The transpose of [`PanelBoundary::potential_at`].
    pub(crate) fn potential_at_vjp(
        &self,
        twist: &Vec6,
        phi: &[f64],
        points: &[Vec3],
        bar: &[f64],
    ) -> SensedBar {
        let (triangles, sources) = (self.panels.triangles(), Sources::new(points));
        let mut own = vec![0.0; 6 * points.len()];
        single_sum(triangles, &sources, &self.six_velocities(), 6, &mut own);
        let rows = own.chunks_exact(6).zip(bar);
        let twist_bar = rows
            .map(|(row, bar)| Vec6::from_row_slice(row) * *bar)
            .sum();
        let mut phi_bar = vec![0.0; phi.len()];
        self.solid_angles(points, |i, angles| {
            let each = phi_bar.iter_mut().zip(angles);
            each.for_each(|(out, angle)| *out -= angle * bar[i]);
        });
        let mut slopes = vec![0.0; 3 * points.len()];
        let q = self.own_normal_velocity(twist);
        single_vjp(triangles, &sources, &q, 1, &mut slopes);
        let minus: Vec<f64> = phi.iter().map(|phi| -phi).collect();
        double_vjp(triangles, &sources, &minus, 1, &mut slopes);
        let slopes = slopes.chunks_exact(3).zip(bar);
        SensedBar {
            twist: twist_bar,
            phi: phi_bar,
            points: slopes
                .map(|(slope, bar)| Vec3::from_column_slice(slope) * *bar)
                .collect(),
        }
    }

    /// Ω/4π of all panels as each point sees them.
    fn solid_angles(
        &self,
        points: &[Vec3],
        mut each: impl FnMut(usize, &mut dyn Iterator<Item = f64>),
    ) {
        let mut angles = Vec::new();
        for (group, points) in points.chunks(BLOCK).enumerate() {
            let (n, count) = (self.faces.len(), points.len());
            angles.resize(n * count, 0.0);
            let sources = Sources::new(points);
            let triangles = self.panels.triangles();
            double_fill(triangles, &sources, Write::Set, &mut angles, count, 0);
            for i in 0..count {
                each(
                    group * BLOCK + i,
                    &mut (0..n).map(|j| angles[j * count + i]),
                );
            }
        }
    }

    /// The transpose of [`PanelBoundary::velocity`] with the normal velocities of a twist.
    pub(crate) fn velocity_vjp(
        &self,
        twist: &Vec6,
        phi: &[f64],
        points: &[Vec3],
        bar: &[Vec3],
    ) -> SensedBar {
        let (triangles, sources) = (self.panels.triangles(), Sources::new(points));
        let (count, ones) = (points.len(), vec![1.0; points.len()]);
        let along = |k: usize| -> Vec<Vec3> {
            let axis = Vec3::ith(k, 1.0);
            bar.iter().map(|bar| bar.cross(&axis)).collect()
        };
        let along = [along(0), along(1), along(2)];
        let against: Vec<Vec3> = bar.iter().map(|bar| -bar).collect();

        let sheet = along.each_ref().map(|d| {
            let mut out = vec![0.0; phi.len()];
            single_jvp(triangles, &sources, d, &ones, 1, &mut out);
            out
        });
        let [x, y, z] = &sheet;
        let of = |j: usize| Vec3::new(x[j], y[j], z[j]);
        let sheet: Vec<Vec3> = (0..phi.len()).map(of).collect();

        let mut own = vec![0.0; 18 * count];
        single_vjp(triangles, &sources, &self.six_velocities(), 6, &mut own);
        let twist_bar = |k: usize| -> f64 {
            let of = |i: usize| Vec3::from_column_slice(&own[18 * i + 3 * k..][..3]);
            (0..count).map(|i| against[i].dot(&of(i))).sum()
        };

        let mut bent = vec![0.0; 3 * count];
        let vorticity = self.vorticity(phi);
        for (c, d) in along.iter().enumerate() {
            let density: Vec<f64> = vorticity.iter().map(|g| g[c]).collect();
            single_hvp(triangles, &sources, d, &density, 1, &mut bent);
        }
        let q = self.own_normal_velocity(twist);
        single_hvp(triangles, &sources, &against, &q, 1, &mut bent);
        SensedBar {
            twist: Vec6::from_fn(|k, _| twist_bar(k)),
            phi: sheet_bar(self, &sheet),
            points: bent.chunks_exact(3).map(Vec3::from_column_slice).collect(),
        }
    }
}
