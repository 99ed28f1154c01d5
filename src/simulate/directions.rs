//! Directions in which what a rollout depends on changes, side by side.

use super::{Initial, Rollout};
use crate::dynamics::Parameters;
use crate::{Error, Result};
use nalgebra::DMatrix;

/// A direction in which what a rollout depends on changes: the counterpart of a [`Gradient`](super::Gradient).
#[derive(Clone, Debug)]
pub struct Displacement {
    /// Of the open-loop controls, controls × steps.
    pub controls: DMatrix<f64>,
    /// Of the initial state; what a motion drives doesn't take part.
    pub initial: Initial,
    /// Of the parameters.
    pub parameters: Parameters,
    /// Of the controller's gains.
    pub gains: Vec<f64>,
}

/// With respect to what a Jacobian is taken; its columns come in this order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Variables {
    /// The parameters of these names.
    pub parameters: Vec<String>,
    /// The initial coordinates in their tangent space.
    pub initial_q: bool,
    /// The initial velocity.
    pub initial_v: bool,
    /// The controller's gains.
    pub gains: bool,
    /// The open-loop controls: those of the first step, then those of the second, …
    pub controls: bool,
}

/// Directions side by side, K of them.
pub(super) struct Directions<'a> {
    /// nv × K.
    pub q: DMatrix<f64>,
    pub v: DMatrix<f64>,
    /// Chosen parameters × K, with their places.
    pub parameters: DMatrix<f64>,
    pub places: Vec<usize>,
    /// Where chosen ones have an effect beside their own: a row of `parameters`, a parameter's place, the slope.
    pub follows: Vec<(usize, usize, f64)>,
    /// Gains × K.
    pub gains: DMatrix<f64>,
    /// Controls × K, at a step.
    pub controls: Box<dyn Fn(usize) -> DMatrix<f64> + 'a>,
}

impl Rollout {
    /// What follows from the parameters at these places.
    fn followers(&self, places: &[usize]) -> Vec<(usize, usize, f64)> {
        let shapes = &self.simulator.system().shapes;
        shapes.followers(self.simulator.parameters(), places)
    }

    /// Displacements side by side, without the parameters that none displacements.
    pub(super) fn directions_of<'a>(&self, displacements: &'a [Displacement]) -> Directions<'a> {
        let count = displacements.len();
        let nv = self.simulator.system().tree.velocities();
        let start = displacements.iter().map(|c| {
            let (mut q, mut v) = (c.initial.q.clone(), c.initial.v.clone());
            self.simulator.forget_driven(&mut q, &mut v);
            (q, v)
        });
        let start: Vec<_> = start.collect();
        let moves = |i: &usize| {
            displacements
                .iter()
                .any(|c| c.parameters.as_slice()[*i] != 0.0)
        };
        let all = self.simulator.parameters().as_slice().len();
        let places: Vec<usize> = (0..all).filter(moves).collect();
        let gains = self.simulator.policy().gains().len();
        let nu = self.controls.nrows();
        Directions {
            q: DMatrix::from_fn(nv, count, |i, k| start[k].0[i]),
            v: DMatrix::from_fn(nv, count, |i, k| start[k].1[i]),
            parameters: DMatrix::from_fn(places.len(), count, |i, k| {
                displacements[k].parameters.as_slice()[places[i]]
            }),
            follows: self.followers(&places),
            places,
            gains: DMatrix::from_fn(gains, count, |i, k| displacements[k].gains[i]),
            controls: Box::new(move |n| {
                DMatrix::from_fn(nu, count, |i, k| displacements[k].controls[(i, n)])
            }),
        }
    }

    /// A direction for each variable.
    pub(super) fn directions_to(&self, variables: &Variables) -> Result<Directions<'_>> {
        let nv = self.simulator.system().tree.velocities();
        let table = self.simulator.parameters();
        let places = variables.parameters.iter().map(|name| table.place(name));
        let places = places.collect::<Result<Vec<usize>>>()?;
        let gains = self.simulator.policy().gains().len();
        let (nu, steps) = (self.controls.nrows(), self.steps());
        let part = |wanted: bool, size: usize| if wanted { size } else { 0 };
        let parameters = 0..places.len();
        let q = parameters.end..parameters.end + part(variables.initial_q, nv);
        let v = q.end..q.end + part(variables.initial_v, nv);
        let own_gains = v.end..v.end + part(variables.gains, gains);
        let controls = own_gains.end..own_gains.end + part(variables.controls, nu * steps);
        let count = controls.end;
        let units = |rows: usize, range: &std::ops::Range<usize>| {
            let mut out = DMatrix::zeros(rows, count);
            out.columns_range_mut(range.clone()).fill_with_identity();
            out
        };
        let (mut by_q, mut by_v) = (units(nv, &q), units(nv, &v));
        for k in 0..count {
            let (mut q, mut v) = (by_q.column(k).into_owned(), by_v.column(k).into_owned());
            self.simulator.forget_driven(&mut q, &mut v);
            by_q.set_column(k, &q);
            by_v.set_column(k, &v);
        }
        Ok(Directions {
            q: by_q,
            v: by_v,
            parameters: units(places.len(), &parameters),
            follows: self.followers(&places),
            places,
            gains: units(gains, &own_gains),
            controls: Box::new(move |n| {
                let at = controls.start + n * nu;
                let acts = |i: usize, k: usize| !controls.is_empty() && k == at + i;
                DMatrix::from_fn(nu, count, |i, k| f64::from(acts(i, k)))
            }),
        })
    }

    pub(super) fn check_displacements(&self, displacements: &[Displacement]) -> Result<()> {
        let zero = self.zero_displacement();
        for (k, given) in displacements.iter().enumerate() {
            let refuse = |name: &str, given: String, right: String| {
                Err(Error::input(
                    format!("displacements[{k}].{name}"),
                    given,
                    right,
                ))
            };
            if !given.parameters.same_table(&zero.parameters) {
                let right = "must be those of this rollout's simulator";
                return refuse("parameters", "another scene's".into(), right.into());
            }
            let column = |x: &[f64]| DMatrix::from_column_slice(x.len(), 1, x);
            let parts = |c: &Displacement| {
                [
                    ("controls", c.controls.clone()),
                    ("initial.q", column(c.initial.q.as_slice())),
                    ("initial.v", column(c.initial.v.as_slice())),
                    ("gains", column(&c.gains)),
                    ("parameters", column(c.parameters.as_slice())),
                ]
            };
            for ((name, given), (_, right)) in parts(given).into_iter().zip(parts(&zero)) {
                if given.shape() != right.shape() {
                    let right = format!("must have the shape {:?}", right.shape());
                    return refuse(name, format!("{:?}", given.shape()), right);
                }
                if let Some(bad) = given.iter().find(|x| !x.is_finite()) {
                    return refuse(name, bad.to_string(), "must be finite".into());
                }
            }
        }
        Ok(())
    }
}

impl Directions<'_> {
    /// Changes of the parameters along direction `k`; none where they stay.
    pub fn parameters_of(&self, k: usize, at: &Parameters) -> Option<Parameters> {
        let column = self.parameters.column(k);
        if column.iter().all(|x| *x == 0.0) {
            return None;
        }
        let mut values = vec![0.0; at.as_slice().len()];
        for (place, x) in self.places.iter().zip(column.iter()) {
            values[*place] += x;
        }
        for (from, to, slope) in &self.follows {
            values[*to] += slope * column[*from];
        }
        at.with_values(&values)
    }
}
