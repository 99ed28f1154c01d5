//! Volume, area, centroid and inertia of the volume inside a closed mesh, in closed form.
//!
//! The volume is the sum of signed tetrahedra from a reference point to the faces, so any closed
//! mesh is right, convex or not. For a tetrahedron with one corner at the reference and the others
//! at a, b, c, with det = a · (b × c) and s = a + b + c,
//!
//! ∫ dV = det/6,  ∫ x dV = det/24 s,  ∫ x xᵀ dV = det/120 (a aᵀ + b bᵀ + c cᵀ + s sᵀ).
//!
//! # References
//! F. Tonon, "Explicit exact formulas for the 3-D tetrahedron inertia tensor in terms of its
//! vertex coordinates", J. Math. Stat. 1 (2005) 8–11.

use super::mesh::TriMesh;
use super::points::area_vector;
use hydrograd_adjoint::lie::{Mat3, Pose, Vec3};
use nalgebra::Matrix3;

/// What a body filled evenly at unit density has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// Volume, m³.
    pub volume: f64,
    /// Area of the surface, m².
    pub area: f64,
    /// Centroid of the volume, m, frame of the shape.
    pub centroid: Vec3,
    /// Inertia about the centroid per unit density, axes of the shape, m⁵: kg m² after
    /// multiplication with kg/m³.
    pub inertia: Mat3,
}

impl MassProperties {
    /// Of the volume inside `mesh`.
    pub fn of(mesh: &TriMesh) -> Self {
        // About the middle of the bounding box: far from the origin, differences of large
        // numbers would eat the digits.
        let [low, high] = mesh.bounds();
        let reference = low + (high - low) * 0.5;
        let mut area = 0.0;
        let mut volume = 0.0;
        let mut first = Vec3::zeros();
        let mut second = Mat3::zeros();
        for f in 0..mesh.faces().len() {
            let corners = mesh.corners(f).map(|x| x - reference);
            area += area_vector(&corners).norm();
            let [a, b, c] = corners;
            let det = a.dot(&b.cross(&c));
            let s = a + b + c;
            volume += det;
            first += det * s;
            second += det
                * (a * a.transpose() + b * b.transpose() + c * c.transpose() + s * s.transpose());
        }
        volume /= 6.0;
        let offset = first / (24.0 * volume);
        let moments = second / 120.0 - volume * offset * offset.transpose();
        Self {
            volume,
            area,
            centroid: reference + offset,
            inertia: Mat3::identity() * moments.trace() - moments,
        }
    }

    /// What is left of it once a part within it is taken out; the surface grows by that of the part.
    #[cfg(feature = "urdf")]
    pub(crate) fn less(&self, part: &Self) -> Self {
        let volume = self.volume - part.volume;
        let first = self.volume * self.centroid - part.volume * part.centroid;
        let centroid = first / volume;
        let moved = |of: &Self| {
            let away = of.centroid - centroid;
            let steiner = Mat3::identity() * away.norm_squared() - away * away.transpose();
            of.inertia + of.volume * steiner
        };
        Self {
            volume,
            area: self.area + part.area,
            centroid,
            inertia: moved(self) - moved(part),
        }
    }

    /// The same of the body placed at `pose`.
    pub fn transformed(&self, pose: &Pose) -> Self {
        Self {
            centroid: pose.apply(&self.centroid),
            inertia: pose.rotation * self.inertia * pose.rotation.transpose(),
            ..*self
        }
    }
}

impl TriMesh {
    /// Volume, area, centroid and inertia.
    pub fn mass_properties(&self) -> MassProperties {
        MassProperties::of(self)
    }
}

/// Why no distribution of mass has this inertia about its centre of mass (xx, yy, zz, xy, xz, yz, kg m²); `slack` is what may be missing, of the largest principal
/// moment. `None` where one has.
pub(crate) fn impossible_inertia(i: &[f64; 6], slack: f64) -> Option<String> {
    let mut moments =
        Matrix3::new(i[0], i[3], i[4], i[3], i[1], i[5], i[4], i[5], i[2]).symmetric_eigenvalues();
    moments.as_mut_slice().sort_by(f64::total_cmp);
    let slack = slack * moments.amax();
    let principal = format!("principal moments {:?} kg m²", moments.as_slice());
    if moments[0] < -slack {
        return Some(format!(
            "an inertia has no negative principal moment; this one has the {principal}"
        ));
    }
    (moments[0] + moments[1] < moments[2] - slack).then(|| {
        format!(
            "no distribution of mass has a principal moment above the sum of the other two; \
             this one has the {principal}. Moments are taken about the centre of mass"
        )
    })
}
