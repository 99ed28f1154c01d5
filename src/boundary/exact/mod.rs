//! Spheres and ellipsoids by formula: no mesh.
//!
//! The added mass and the flow of the moving body are Lamb's ([`lamb`]). What the body adds to the flow
//! of a source is an image in closed form for a sphere ([`sphere`]).

mod confocal;
pub mod lamb;
mod sphere;

use crate::adjoint::lie::{Mat6, Pose, Vec3, skew};
use crate::boundary::Response;
use crate::{Error, Result};
use confocal::Confocal;
use faer::Mat;
use lamb::Lamb;
use rayon::prelude::*;

/// A sphere or an ellipsoid in unbounded water.
#[derive(Clone, Debug)]
pub struct ExactBoundary {
    /// Name, for messages.
    pub name: String,
    /// Semi-axes along the shape's x, y, z, m.
    pub semi_axes: [f64; 3],
    /// The shape's frame in the body's frame.
    pub pose: Pose,
    /// Distance from the surface, m, from which sources are answered to the accuracy
    /// [`ExactBoundary::residual`].
    pub resolved_gap: f64,
    /// Relative error of the normal velocity on the surface, in the worst case of unit sources at the
    /// distance `resolved_gap`; 0 for a sphere.
    pub residual: f64,
    added_mass: Mat6,
    lamb: Lamb,
    confocal: Confocal,
    warnings: Vec<String>,
}

impl ExactBoundary {
    /// The ellipsoid of `semi_axes` (m) whose frame is at `pose` in the body's frame. Sources at the
    /// distance `resolved_gap` (m) from the surface and beyond are resolved.
    ///
    /// # Errors
    /// [`Error::Input`] for semi-axes or a gap that aren't finite and positive, and for a pose that is
    /// none.
    pub fn new(name: &str, semi_axes: [f64; 3], pose: &Pose, resolved_gap: f64) -> Result<Self> {
        lamb::check(&format!("body \"{name}\""), semi_axes)?;
        if !(resolved_gap.is_finite() && resolved_gap > 0.0) {
            return Err(Error::input(
                format!("body \"{name}\": resolved gap"),
                resolved_gap,
                "give a finite, positive distance in metres",
            ));
        }
        check_pose(name, pose)?;
        let lamb = Lamb::new(semi_axes);
        let move_in = twist_in_shape(pose);
        let added_mass = move_in.transpose() * lamb.added_mass() * move_in;
        Ok(Self {
            name: name.to_string(),
            semi_axes,
            pose: *pose,
            resolved_gap,
            residual: 0.0,
            added_mass: 0.5 * (added_mass + added_mass.transpose()),
            lamb,
            confocal: Confocal::new(semi_axes),
            warnings: Vec::new(),
        })
    }

    fn is_sphere(&self) -> bool {
        self.confocal.offsets[0] == 0.0
    }

    /// Body-frame points in the shape's frame.
    fn inside_shape(&self, points: &[Vec3]) -> Vec<Vec3> {
        points.iter().map(|x| self.pose.apply_inverse(x)).collect()
    }
}

/// Twist about the shape's origin, in its frame, of a twist about the body's origin, in its frame.
fn twist_in_shape(pose: &Pose) -> Mat6 {
    let turn = pose.rotation.transpose();
    let mut out = Mat6::zeros();
    out.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
    out.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
    // u + ω × t
    let lever = -turn * skew(&pose.translation);
    out.fixed_view_mut::<3, 3>(0, 3).copy_from(&lever);
    out
}

fn check_pose(name: &str, pose: &Pose) -> Result<()> {
    let t = &pose.translation;
    if !t.iter().all(|x| x.is_finite()) {
        return Err(Error::input(
            format!("body \"{name}\": position of the shape"),
            format!("({}, {}, {})", t.x, t.y, t.z),
            "give finite coordinates in metres",
        ));
    }
    let r = &pose.rotation;
    let off = (r.transpose() * r - crate::adjoint::lie::Mat3::identity())
        .abs()
        .max();
    if off.is_nan() || off > 1e-9 || r.determinant() < 0.0 {
        return Err(Error::input(
            format!("body \"{name}\": rotation of the shape"),
            format!(
                "a matrix {off:.3e} from orthogonal, determinant {:.6}",
                r.determinant()
            ),
            "give a rotation matrix",
        ));
    }
    Ok(())
}

impl Response for ExactBoundary {
    fn added_mass(&self) -> Mat6 {
        self.added_mass
    }

    fn radiated(&self, points: &[Vec3]) -> Result<Mat<f64>> {
        let move_in = twist_in_shape(&self.pose);
        let rows = self
            .inside_shape(points)
            .par_iter()
            .map(|x| {
                let place = self.confocal.locate(&self.name, x)?;
                let own = self.lamb.potentials(&self.confocal, x, place.level);
                Ok(move_in.tr_mul(&own))
            })
            .collect::<Result<Vec<_>>>()?;
        Ok(Mat::from_fn(points.len(), 6, |i, j| rows[i][j]))
    }

    fn scattered(&self, sources: &[Vec3], points: &[Vec3]) -> Result<Mat<f64>> {
        let (sources, points) = (self.inside_shape(sources), self.inside_shape(points));
        for x in sources.iter().chain(&points) {
            self.confocal.locate(&self.name, x)?;
        }
        if !self.is_sphere() {
            return Err(Error::Unsupported {
                what: format!("body \"{}\": an ellipsoid in the flow of others", self.name),
                why: "not written yet".into(),
                instead: "use a mesh".into(),
            });
        }
        let radius = self.semi_axes[0];
        Ok(Mat::from_fn(points.len(), sources.len(), |i, j| {
            sphere::image(radius, &sources[j], &points[i])
        }))
    }

    fn asymmetry(&self) -> f64 {
        0.0
    }

    fn condition(&self) -> f64 {
        1.0
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }
}
