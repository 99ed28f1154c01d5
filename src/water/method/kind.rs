//! What a body method must answer.

use crate::Result;
use crate::boundary::Response;
use crate::geometry::TriMesh;
use crate::water::device::Device;
use crate::water::numerics::Numerics;
use crate::water::submerged::{Made, Problem, SubmergedBody};
use std::borrow::Cow;

/// A way to solve one body in unbounded fluid, and, where it has one, its coupled system of all bodies.
pub(crate) trait BodyMethod: Send + Sync {
    /// Its name in reports of single bodies.
    fn label(&self) -> &'static str;

    /// Another method that it leaves this body to.
    ///
    /// # Errors
    /// A body that it can't solve.
    fn leaves_to(&self, _: &SubmergedBody) -> Result<Option<&'static dyn BodyMethod>> {
        Ok(None)
    }

    /// Whether it solves ellipsoids by formula, whatever their mesh.
    fn by_formula(&self) -> bool {
        false
    }

    /// Whether it extrapolates from a second, coarser mesh where there is one.
    fn extrapolates(&self) -> bool {
        false
    }

    /// The surface around which it is compressed, in the body's frame.
    ///
    /// # Errors
    /// A body without a shape.
    fn layout<'a>(&self, body: &SubmergedBody<'a>) -> Result<Cow<'a, TriMesh>> {
        Ok(Cow::Borrowed(body.surface("reduced")?))
    }

    /// What its response is made from, beside the layout: the key under which a compressed body is kept.
    fn made_from(&self, body: &SubmergedBody, numerics: &Numerics) -> serde_json::Value;

    /// The body alone, resolved for sources as near as `gap`, m.
    ///
    /// # Errors
    /// A body without a shape, or one that can't be solved on its mesh.
    fn response(
        &self,
        body: &SubmergedBody,
        numerics: &Numerics,
        gap: f64,
    ) -> Result<Box<dyn Response>>;

    /// All bodies solved together (fidelity full).
    ///
    /// # Errors
    /// A method that solves single bodies only, or whatever the discretisation reports.
    fn couple(&self, problem: &Problem, device: &mut Device) -> Result<Made>;

    /// Whether motion can be computed with all bodies solved together.
    fn steps_together(&self) -> bool {
        false
    }

    /// Refuses the GPU for all bodies solved together.
    ///
    /// # Errors
    /// A method whose coupled system is solved on the CPU alone.
    fn check_gpu(&self) -> Result<()> {
        Ok(())
    }
}

/// The method for a body where `method` is asked for: itself, or the one that it leaves the body to.
///
/// # Errors
/// A body that it can't solve.
pub(crate) fn for_body(
    method: &'static dyn BodyMethod,
    body: &SubmergedBody,
) -> Result<&'static dyn BodyMethod> {
    Ok(method.leaves_to(body)?.unwrap_or(method))
}
