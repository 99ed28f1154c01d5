//! The paper's semi-implicit Euler in velocity (Eq. 3–4): v⁺ = v + Δt a(q, v, u), q⁺ = q ⊕ Δt v⁺.

use super::euler::{advance, advance_vjp, next_state};
use super::{Input, Split, State, StateBar, StepBar, Stepped, Stepper, When, readout};
use crate::Result;
use crate::dynamics::Evaluation;
use nalgebra::DVector;

/// Acceleration: driven joints reach their new velocity within the step, the others follow Eq. 3.
fn acceleration(
    s: &Stepper,
    e: &Evaluation,
    split: &Split,
    v: &DVector<f64>,
    control: &DVector<f64>,
) -> Result<DVector<f64>> {
    let mut driven = (&split.driven - v) / s.dt;
    for &i in &split.free {
        driven[i] = 0.0;
    }
    let right = e.inertial_force(v, control) - &e.mass_matrix * &driven;
    let free = readout::factor(e, split)?.solve(&split.take(&right));
    Ok(driven + split.put(&free))
}

pub(super) fn step(
    s: &Stepper,
    e: &Evaluation,
    state: &State,
    v: &DVector<f64>,
    input: &Input,
) -> Result<Stepped> {
    let split = s.split(&input.hold, When::Over(s.time(state), s.dt));
    let a = acceleration(s, e, &split, v, &input.control)?;
    let next = &split.driven + split.put(&split.take(&(v + s.dt * a)));
    let q = advance(s, state, &next);
    let mut state = next_state(state, &split, q, next.clone(), input);
    state.y = next;
    Ok(Stepped { state, memo: None })
}

pub(super) fn step_vjp(
    s: &Stepper,
    e: &Evaluation,
    state: &State,
    v: &DVector<f64>,
    input: &Input,
    next_bar: &StateBar,
) -> Result<StepBar> {
    let split = s.split(&input.hold, When::Over(s.time(state), s.dt));
    let a = acceleration(s, e, &split, v, &input.control)?;
    let next = &split.driven + split.put(&split.take(&(v + s.dt * &a)));
    let mut bar = StepBar::zeros(e);
    let (q_bar, mut next_v_bar) = advance_vjp(s, &split, &next, &next_bar.q);
    bar.state.q += q_bar;
    next_v_bar += &next_bar.y;
    split.forget_driven(&mut next_v_bar);
    bar.v += &next_v_bar;
    // Free rows of M a = G − M_fd a_d, a_d = (v_d − v)/Δt.
    let w = split.put(&readout::factor(e, &split)?.solve(&split.take(&(s.dt * &next_v_bar))));
    let force = e.inertial_force_vjp(v, &input.control, &w)?;
    bar.v += &force.v;
    bar.add(1.0, &force);
    bar.add(-1.0, &e.mass_vjp(&a, &w)?);
    let through_driven = &e.mass_matrix * &w / s.dt;
    for (i, driven) in split.is_driven.iter().enumerate() {
        if *driven {
            bar.v[i] += through_driven[i];
        }
    }
    Ok(bar)
}
