//! Spheres and ellipsoids by formula: no mesh.
//!
//! The added mass and the flow of the moving body are Lamb's ([`lamb`]). What the body adds to the flow
//! of a source is an image in closed form for a sphere (`image`), a sum of ellipsoidal harmonics for
//! others (`harmonic`): a scattering matrix that is diagonal, so nothing is solved.

mod confocal;
mod harmonic;
pub mod lamb;
mod surface;

use crate::adjoint::lie::{Mat6, Pose, Vec3, skew};
use crate::boundary::Response;
use crate::error::in_order;
use crate::{Error, Result};
use confocal::{Confocal, Place};
use faer::Mat;
use harmonic::Harmonics;
use lamb::Lamb;
use rayon::prelude::*;
pub use surface::EllipsoidSurface;

/// Residual above which a warning is given.
const WANTED: f64 = 1e-4;
/// Differences of squared semi-axes, relative, below which an ellipsoid is a sphere.
const ROUND: f64 = 1e-9;

/// A sphere or an ellipsoid in unbounded water. `added_mass` and `radiated` are exact; `scattered` is exact for
/// a sphere, and as good as `residual` for an ellipsoid where sources or points are at `resolved_gap` or
/// farther. Nearer ones are answered as long as the error, estimated from the last harmonics, is below 1e-3, and
/// refused beyond (about half the gap on both sides).
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
    /// None for a sphere.
    harmonics: Option<Harmonics>,
    warnings: Vec<String>,
}

impl ExactBoundary {
    /// The ellipsoid of `semi_axes` (m) whose frame is at `pose` in the body's frame. Sources at the
    /// distance `resolved_gap` (m) from the surface and beyond are resolved.
    ///
    /// # Errors
    /// [`Error::Input`] for semi-axes or a gap that aren't finite and positive, and for a pose that is
    /// none; [`Error::Unresolved`] for a gap below a fiftieth of an ellipsoid's longest semi-axis.
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
        let confocal = Confocal::new(semi_axes);
        let (harmonics, residual) = if confocal.offsets[0] <= ROUND * semi_axes[0] * semi_axes[0] {
            (None, 0.0)
        } else {
            let harmonics = Harmonics::new(name, &confocal, resolved_gap)?;
            let residual = harmonics.residual(name)?;
            (Some(harmonics), residual)
        };
        let mut warnings = Vec::new();
        if residual > WANTED {
            warnings.push(format!(
                "body \"{name}\": sources at the resolved gap {resolved_gap:.3e} m leave {residual:.1e} of their \
                 normal velocity (more than {WANTED:.0e}) on the surface of the ellipsoid with semi-axes \
                 {semi_axes:?} m; ask for a gap that is a larger part of the longest semi-axis"
            ));
        }
        let move_in = twist_in_shape(pose);
        let added_mass = move_in.transpose() * lamb.added_mass() * move_in;
        Ok(Self {
            name: name.to_string(),
            semi_axes,
            pose: *pose,
            resolved_gap,
            residual,
            added_mass: 0.5 * (added_mass + added_mass.transpose()),
            lamb,
            confocal,
            harmonics,
            warnings,
        })
    }

    /// ∂M of the added mass at unit density (body frame, about its origin) with each semi-axis: m², m³, m⁴.
    pub fn added_mass_slopes(&self) -> [Mat6; 3] {
        let move_in = twist_in_shape(&self.pose);
        lamb::slopes(self.semi_axes).map(|slope| {
            let turned = move_in.transpose() * slope * move_in;
            0.5 * (turned + turned.transpose())
        })
    }

    /// Number of harmonics that are kept, and their highest degree; zeros for a sphere.
    pub fn harmonics(&self) -> (usize, usize) {
        self.harmonics.as_ref().map_or((0, 0), Harmonics::size)
    }

    /// Body-frame points in the shape's frame.
    fn inside_shape(&self, points: &[Vec3]) -> Vec<Vec3> {
        points.iter().map(|x| self.pose.apply_inverse(x)).collect()
    }
}

/// Twist about the shape's origin, in its frame, of a twist about the body's origin, in its frame.
fn twist_in_shape(pose: &Pose) -> Mat6 {
    let rotation = pose.rotation.transpose();
    let mut out = Mat6::zeros();
    out.fixed_view_mut::<3, 3>(0, 0).copy_from(&rotation);
    out.fixed_view_mut::<3, 3>(3, 3).copy_from(&rotation);
    // u + ω × t
    let lever = -rotation * skew(&pose.translation);
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
        let row = |x: &Vec3| {
            let place = self.confocal.locate(&self.name, x)?;
            let own = self.lamb.potentials(&self.confocal, x, place.level);
            Ok(move_in.tr_mul(&own))
        };
        let rows = in_order(self.inside_shape(points).par_iter().map(row))?;
        Ok(Mat::from_fn(points.len(), 6, |i, j| rows[i][j]))
    }

    fn scattered(&self, sources: &[Vec3], points: &[Vec3]) -> Result<Mat<f64>> {
        let (sources, points) = (self.inside_shape(sources), self.inside_shape(points));
        let places = |list: &[Vec3]| -> Result<Vec<Place>> {
            in_order(list.par_iter().map(|x| self.confocal.locate(&self.name, x)))
        };
        let (from, to) = (places(&sources)?, places(&points)?);
        if let Some(harmonics) = &self.harmonics {
            return harmonics.scattered(&self.name, &from, &to);
        }
        let radius = self.semi_axes[0];
        Ok(Mat::from_fn(points.len(), sources.len(), |i, j| {
            image(radius, &sources[j], &points[i])
        }))
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }
}

/// Potential at x of the flow that a sphere adds to a unit source at y; both outside, m. 1/m.
///
/// The source `1/|x − y|` outside a sphere of radius a around the origin has its image in the point
/// y' = a² y/|y|², of strength a/|y|, and in a line of sinks of strength −1/a per length from the centre to
/// y':
///
/// ```text
/// φ = (a/|y|) / |x − y'| − (1/a) ∫₀^{|y'|} ds / |x − s y/|y||
///   = Σ_l l/(l+1) a^{2l+1} P_l(cos γ) / (|x| |y|)^{l+1}
/// ```
///
/// The line's potential is ln[(|x| + |x − y'| + |y'|) / (|x| + |x − y'| − |y'|)]: right in all directions.
///
/// # References
/// P. Weiss, "On hydrodynamical images: arbitrary irrotational flow disturbed by a sphere", Proc. Camb.
/// Phil. Soc. 40 (1944) 259–261.
fn image(radius: f64, y: &Vec3, x: &Vec3) -> f64 {
    let (far, near) = (y.norm(), x.norm());
    let depth = radius * (radius / far);
    let image = y * (depth / far);
    let distance = (x - image).norm();
    let sum = near + distance;
    let line = (2.0 * depth / (sum - depth)).ln_1p();
    (radius / far) / distance - line / radius
}
