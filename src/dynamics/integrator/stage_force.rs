//! The force of a stage, with what is taken later than at the stage's velocity ([`crate::dynamics`]'s `late`).

use super::rule::Rule;
use super::start::Start;
use crate::Result;
use crate::dynamics::late::Late;
use crate::dynamics::slopes::unit;
use crate::dynamics::{Linearisation, Slopes};
use nalgebra::{DMatrix, DVector};

impl<'a> Start<'_, 'a> {
    /// What is late of a stage at `e` with the velocity `v`.
    pub fn late<'l>(
        &self,
        e: &Linearisation<'a>,
        v: &'l DVector<f64>,
        rule: Rule,
    ) -> Option<Late<'l>> {
        rule.is_middle().then(|| e.late(v, self.v)).flatten()
    }

    /// f of a stage at `e` with the velocity `v`.
    ///
    /// # Errors
    /// A coupling that fails.
    pub fn stage_force(
        &self,
        e: &Linearisation<'a>,
        v: &DVector<f64>,
        rule: Rule,
    ) -> Result<DVector<f64>> {
        let control = &self.input.control;
        let force = e.force(v, control)?;
        Ok(match self.late(e, v, rule) {
            Some(late) => force + e.late_force(&late, control),
            None => force,
        })
    }

    /// Derivatives of its free entries, and those by the velocity at the step's start.
    ///
    /// # Errors
    /// A solve of the coupling that misses its tolerance.
    pub fn stage_force_slopes(
        &self,
        e: &Linearisation<'a>,
        v: &DVector<f64>,
        rule: Rule,
        by_parameters: bool,
    ) -> Result<(Slopes, DMatrix<f64>)> {
        let (control, entries) = (&self.input.control, &self.split.free);
        let mut out = e.force_slopes(v, control, entries, by_parameters)?;
        let mut by_start = DMatrix::zeros(v.len(), v.len());
        if let Some(late) = self.late(e, v, rule) {
            let bars = |i: &usize| e.late_force_vjp(&late, control, &unit(v.len(), *i));
            for (i, bars) in entries.iter().map(|i| (*i, bars(i))) {
                let force = &bars.force;
                let add = |to: &mut DMatrix<f64>, row: &[f64]| {
                    to.row_mut(i)
                        .iter_mut()
                        .zip(row)
                        .for_each(|(to, x)| *to += x);
                };
                add(&mut out.q, force.q.as_slice());
                add(&mut out.v, force.v.as_slice());
                add(&mut out.control, force.control.as_slice());
                add(&mut out.parameters, force.parameters.as_slice());
                add(&mut by_start, bars.start.as_slice());
            }
        }
        Ok((out, by_start))
    }
}
