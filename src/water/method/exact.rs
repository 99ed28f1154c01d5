//! Closed forms of spheres and ellipsoids.

use super::kind::{BodyMethod, Problem, Solved, far};
use crate::adjoint::lie::Mat6;
use crate::boundary::ExactBoundary;
use crate::geometry::TriMesh;
use crate::scene::Shape;
use crate::shape;
use crate::water::device::Device;
use crate::water::numerics::Numerics;
use crate::water::shape::ShapeChange;
use crate::water::submerged::{Made, SubmergedBody};
use crate::{Error, Result};
use std::borrow::Cow;
use std::path::Path;

/// Faces of the mesh around a body by formula, from which the points of its compression are laid out:
/// what they are fitted to doesn't depend on it.
const LAYOUT_FACES: usize = 2000;

/// Closed forms.
pub(super) struct Exact;

fn no_formula(body: &SubmergedBody) -> Error {
    Error::Unsupported {
        what: format!("the method exact for body {:?}", body.name),
        why: "closed forms are known for spheres and ellipsoids by formula".into(),
        instead: "use the method auto, which takes panels for other bodies, or panel".into(),
    }
}

impl BodyMethod for Exact {
    fn label(&self) -> &'static str {
        "exact"
    }

    fn leaves_to(&self, body: &SubmergedBody) -> Result<Option<&'static dyn BodyMethod>> {
        let known = body.ellipsoid.is_some();
        known.then_some(None).ok_or_else(|| no_formula(body))
    }

    fn by_formula(&self) -> bool {
        true
    }

    fn layout<'a>(&self, body: &SubmergedBody<'a>) -> Result<Cow<'a, TriMesh>> {
        let (semi_axes, pose) = body.ellipsoid.as_ref().ok_or_else(|| no_formula(body))?;
        let shape = Shape::ellipsoid(*semi_axes).faces(LAYOUT_FACES);
        let mesh = shape::build(&shape, Path::new(""), None)?;
        Ok(Cow::Owned(mesh.transformed(pose)))
    }

    fn made_from(&self, body: &SubmergedBody, _: &Numerics) -> serde_json::Value {
        let formula = body.ellipsoid.as_ref().map(|(axes, pose)| {
            let rotation: Vec<f64> = pose.rotation.iter().copied().collect();
            (*axes, rotation, <[f64; 3]>::from(pose.translation))
        });
        serde_json::json!(["exact", formula])
    }

    fn response(&self, body: &SubmergedBody, _: &Numerics, gap: f64) -> Solved {
        let (axes, pose) = body.ellipsoid.as_ref().ok_or_else(|| no_formula(body))?;
        Ok(Box::new(ExactBoundary::new(body.name, *axes, pose, gap)?))
    }

    fn added_mass_slopes(
        &self,
        body: &SubmergedBody,
        _: &Numerics,
        changes: &[&ShapeChange],
    ) -> Result<Vec<Mat6>> {
        let (axes, pose) = body.ellipsoid.as_ref().ok_or_else(|| no_formula(body))?;
        let slopes = ExactBoundary::new(body.name, *axes, pose, far(body))?.added_mass_slopes();
        let along = |change: &&ShapeChange| {
            let rates = change.semi_axes_rates().unwrap_or_default();
            slopes.iter().zip(rates).map(|(m, rate)| m * rate).sum()
        };
        Ok(changes.iter().map(along).collect())
    }

    fn couple(&self, _: &Problem, _: &mut Device) -> Result<Made> {
        Err(Error::Unsupported {
            what: "the method exact with the fidelity full".into(),
            why: "closed forms are of single bodies".into(),
            instead: "use the fidelity reduced, which couples them, or the method panel".into(),
        })
    }
}
