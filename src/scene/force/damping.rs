//! Damping of a body by matrices.

use super::super::is_default;
use super::{Force, Scene, number};
use crate::{Error, Result};
use nalgebra::Matrix6;
use serde::{Deserialize, Serialize};

/// Names of the entries of a twist or wrench: along the axes, then about them.
pub(crate) const AXES: [&str; 6] = ["x", "y", "z", "wx", "wy", "wz"];

/// Least eigenvalue of a damping, its diagonal scaled to one, that counts as not negative.
const LEAST: f64 = -1e-9;

/// Linear and quadratic damping of a body, as marine craft are modelled by: with ν = (u, ω) the twist of the point `at` through the water, body axes, the wrench about
/// that point is −(D_L ν + D_Q |ν| ν), where |ν| ν is taken entry by entry.
///
/// Each is given by axis, six numbers along x, y, z and about x, y, z, or as 6 × 6 rows. The linear one must not feed energy in: the symmetric part of its matrix
/// must be positive semi-definite. Neither may have a negative diagonal; whether a quadratic one with entries beside the diagonal takes energy at every twist isn't checked.
///
/// ```
/// use hydrograd::scene::{Body, Damping, Fluid, Scene, Shape};
///
/// let mut scene = Scene::new(Fluid::fresh_water());
/// scene.add(Body::new(Shape::sphere(0.2)).named("rov").density(1000.0));
/// let damping = Damping::new("rov").linear([4.0, 6.2, 5.2, 0.07, 0.07, 0.07]);
/// scene.add_force(damping.quadratic([18.2, 21.7, 37.0, 1.55, 1.55, 1.55]).into());
/// scene.validate()?;
/// # Ok::<(), hydrograd::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Damping {
    /// Name, unique in the scene; default: "damping" and its number among the forces.
    pub name: Option<String>,
    /// Name of the body.
    pub body: String,
    /// Point that velocity and wrench are taken about, body's frame, m.
    #[serde(default, skip_serializing_if = "is_default")]
    pub at: [f64; 3],
    /// D_L: N s/m, N s, N m s.
    pub linear: Option<Coefficients>,
    /// D_Q: N s²/m², N s², N s²/m, N m s².
    pub quadratic: Option<Coefficients>,
}

/// A damping's coefficients.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "six numbers, along x, y, z and about x, y, z, or six rows of six"
)]
pub enum Coefficients {
    /// One for each axis, along x, y, z and about x, y, z.
    Axes([f64; 6]),
    /// Rows of a matrix.
    Rows(Box<[[f64; 6]; 6]>),
}

impl From<[f64; 6]> for Coefficients {
    fn from(axes: [f64; 6]) -> Self {
        Self::Axes(axes)
    }
}

impl From<[[f64; 6]; 6]> for Coefficients {
    fn from(rows: [[f64; 6]; 6]) -> Self {
        Self::Rows(Box::new(rows))
    }
}

impl Coefficients {
    /// As a matrix.
    pub fn matrix(&self) -> Matrix6<f64> {
        match self {
            Self::Axes(axes) => Matrix6::from_diagonal(&(*axes).into()),
            Self::Rows(rows) => Matrix6::from_fn(|i, j| rows[i][j]),
        }
    }
}

impl Damping {
    /// Of a body, about its origin; it still needs coefficients.
    pub fn new(body: impl Into<String>) -> Self {
        Self {
            body: body.into(),
            ..Self::default()
        }
    }
}

setters! { Damping {
    /// Name, unique in the scene.
    named(name: impl Into<String>) => name = Some(name.into());
    /// Point that velocity and wrench are taken about, body's frame, m.
    at(point: [f64; 3]) => at = point;
    /// D_L: six numbers, or 6 × 6 rows.
    linear(coefficients: impl Into<Coefficients>) => linear = Some(coefficients.into());
    /// D_Q: six numbers, or 6 × 6 rows.
    quadratic(coefficients: impl Into<Coefficients>) => quadratic = Some(coefficients.into());
} }

impl From<Damping> for Force {
    fn from(damping: Damping) -> Self {
        Force::Damping(damping)
    }
}

impl Damping {
    /// Checks all that doesn't need the meshes; `place` names a field.
    pub(super) fn check(&self, scene: &Scene, place: &dyn Fn(&str) -> String) -> Result<()> {
        scene.named_body(&self.body, place("body"))?;
        for x in self.at {
            number(place("at"), x, true, "give finite numbers, in m")?;
        }
        if self.linear.is_none() && self.quadratic.is_none() {
            return Err(Error::input(
                place("linear"),
                "neither linear nor quadratic",
                "give one of them or both: six numbers, along x, y, z and about x, y, z, or six rows of six",
            ));
        }
        for (field, given) in [("linear", &self.linear), ("quadratic", &self.quadratic)] {
            let Some(given) = given else { continue };
            let matrix = given.matrix();
            for (i, j) in (0..6).flat_map(|i| (0..6).map(move |j| (i, j))) {
                let place = match given {
                    Coefficients::Axes(_) => place(&format!("{field}[{i}]")),
                    Coefficients::Rows(_) => place(&format!("{field}[{i}][{j}]")),
                };
                let remedy = match i == j {
                    true => "give zero or more: a negative damping would push the body on",
                    false => "give finite numbers",
                };
                number(place, matrix[(i, j)], i != j, remedy)?;
            }
        }
        let linear = self.linear.as_ref();
        linear.map_or(Ok(()), |given| {
            least_damping(&given.matrix(), place("linear"))
        })
    }
}

/// Refuses a linear damping that feeds energy in at some twist: the symmetric part must be positive semi-definite. Entries have different units: everything is measured
/// against its row's and column's diagonal.
pub(crate) fn least_damping(matrix: &Matrix6<f64>, place: String) -> Result<()> {
    let symmetric = 0.5 * (matrix + matrix.transpose());
    let size = |i: usize, j: usize| (symmetric[(i, i)] * symmetric[(j, j)]).sqrt();
    for (i, j) in (0..6).flat_map(|i| (0..i).map(move |j| (i, j))) {
        let x = symmetric[(i, j)];
        if x != 0.0 && size(i, j) == 0.0 {
            return Err(Error::input(
                place,
                format!(
                    "{x} between {} and {} in its symmetric part, and a diagonal of zero there",
                    AXES[j], AXES[i]
                ),
                "damping must take energy at every twist: give that diagonal a value above zero, or entries across the diagonal that cancel",
            ));
        }
    }
    let scaled = Matrix6::from_fn(|i, j| match symmetric[(i, j)] {
        0.0 => 0.0,
        x => x / size(i, j),
    });
    let least = scaled.symmetric_eigenvalues().min();
    match least >= LEAST {
        true => Ok(()),
        false => Err(Error::input(
            place,
            format!("least eigenvalue {least:.3e} of its symmetric part (diagonal scaled to one)"),
            "damping must take energy at every twist: make the symmetric part positive semi-definite; mind the signs off the diagonal",
        )),
    }
}
