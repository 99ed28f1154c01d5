//! Linear and quadratic damping of a body by matrices, in its own frame about a point of it: −(D_L ν + D_Q |ν| ν), with ν the twist of the point through the
//! water, |ν| ν taken entry by entry: the quadratic one pushes along entry i with −Σ_j D_Q[i][j] |ν_j| ν_j.
//!
//! # References
//! T. I. Fossen, *Handbook of Marine Craft Hydrodynamics and Motion Control*, 2nd ed., Wiley 2021, section 6.4 (viscous damping D and D_n(ν_r)).

use super::local::{Law, Local, about};
use super::{ForceModel, ForceParts, LoadBars, Moving};
use crate::Result;
use crate::adjoint::lie::{Mat6, Vec6};
use crate::dynamics::parameters::{Declarations, Declared, Owner, Parameter, Parameters, Range};
use crate::scene::{AXES, Coefficients, Force, least_damping};

/// Units of a matrix's blocks: force and moment (rows) by velocity and rate (columns).
const LINEAR: [[&str; 2]; 2] = [["N s/m", "N s"], ["N s", "N m s"]];
const QUADRATIC: [[&str; 2]; 2] = [["N s²/m²", "N s²"], ["N s²/m", "N m s²"]];

struct Damping {
    body: usize,
    /// What makes of a twist about the body's origin that about the point.
    about: Mat6,
    linear: Vec<Entry>,
    quadratic: Vec<Entry>,
    /// Where the scene gives it, for messages.
    place: String,
}

/// One entry of a matrix.
struct Entry {
    row: usize,
    column: usize,
    value: Parameter,
}

pub(super) fn assemble(
    parts: &ForceParts,
    parameters: &mut Declarations,
) -> Option<Box<dyn ForceModel>> {
    let scene = parts.scene;
    let mut laws = Vec::new();
    for (i, force) in scene.forces.iter().enumerate() {
        let Force::Damping(given) = force else {
            continue;
        };
        let owner = Owner::Named(scene.force_name(i));
        let mut declare = |name, units: &[[&'static str; 2]; 2], of: &Option<Coefficients>| {
            let entry = |(row, column, part, value): (usize, usize, String, f64)| {
                let declared = Declared::new(name, units[row / 3][column / 3]);
                let declared = match row == column {
                    true => declared,
                    false => declared.range(Range::Finite).size(|value, _| value.abs()),
                };
                Entry {
                    row,
                    column,
                    value: parameters.declare_part(owner.clone(), declared, &part, value),
                }
            };
            let entries = of.as_ref().map(entries).unwrap_or_default();
            entries.into_iter().map(entry).collect()
        };
        laws.push(Damping {
            body: scene.body(&given.body).map_or(0, |b| b.0),
            about: about(&given.at.into()),
            linear: declare("linear", &LINEAR, &given.linear),
            quadratic: declare("quadratic", &QUADRATIC, &given.quadratic),
            place: format!("parameters {}.linear", scene.force_name(i)),
        });
    }
    Local::assemble("damping", laws)
}

/// Row, column, name and value of each entry that is given: by axis, `x`, or by two axes, `x.wz`.
fn entries(given: &Coefficients) -> Vec<(usize, usize, String, f64)> {
    match given {
        Coefficients::Axes(values) => {
            let each = values.iter().enumerate();
            each.map(|(i, x)| (i, i, AXES[i].into(), *x)).collect()
        }
        Coefficients::Rows(rows) => {
            let each = (0..6).flat_map(|i| (0..6).map(move |j| (i, j)));
            each.map(|(i, j)| (i, j, format!("{}.{}", AXES[i], AXES[j]), rows[i][j]))
                .collect()
        }
    }
}

fn matrix(entries: &[Entry], parameters: &Parameters) -> Mat6 {
    let mut out = Mat6::zeros();
    for e in entries {
        out[(e.row, e.column)] = parameters[e.value];
    }
    out
}

impl Law for Damping {
    fn body(&self) -> usize {
        self.body
    }

    fn wrench(&self, nu: &Vec6, at: &Moving) -> Vec6 {
        let parameters = at.place.parameters;
        let nu = self.about * nu;
        let squares = nu.map(|x| x.abs() * x);
        let linear = matrix(&self.linear, parameters) * nu;
        let quadratic = matrix(&self.quadratic, parameters) * squares;
        -self.about.tr_mul(&(linear + quadratic))
    }

    fn slope(&self, nu: &Vec6, at: &Moving) -> Mat6 {
        let parameters = at.place.parameters;
        let rates = (self.about * nu).map(|x| 2.0 * x.abs());
        let quadratic = matrix(&self.quadratic, parameters) * Mat6::from_diagonal(&rates);
        let local = matrix(&self.linear, parameters) + quadratic;
        -self.about.tr_mul(&(local * self.about))
    }

    fn inputs_vjp(&self, nu: &Vec6, zeta: &Vec6, _: &Moving, bar: &mut LoadBars) {
        let (nu, zeta) = (self.about * nu, self.about * zeta);
        for e in &self.linear {
            bar.parameters[e.value] -= zeta[e.row] * nu[e.column];
        }
        for e in &self.quadratic {
            bar.parameters[e.value] -= zeta[e.row] * nu[e.column].abs() * nu[e.column];
        }
    }

    fn acts(&self, parameters: &Parameters) -> bool {
        let mut all = self.linear.iter().chain(&self.quadratic);
        all.any(|e| parameters[e.value] != 0.0)
    }

    /// By axes: a matrix needn't be symmetric.
    fn resists(&self) -> bool {
        let mut all = self.linear.iter().chain(&self.quadratic);
        all.all(|e| e.row == e.column)
    }

    fn check(&self, parameters: &Parameters) -> Result<()> {
        least_damping(&matrix(&self.linear, parameters), self.place.clone())
    }
}
