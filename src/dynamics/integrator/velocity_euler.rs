//! The paper's semi-implicit Euler in velocity (Eq. 3–4): v⁺ = v + Δt a(q, v, u), q⁺ = q ⊕ Δt v⁺.
//!
//! With contact, v⁺ is what [`contact::solve`] makes of that velocity at q.

use super::euler::{advance, advance_vjp, next_state, stage_name};
use super::{
    Input, Memo, Split, State, StateBar, StepBar, Stepped, Stepper, When, contact, readout,
};
use crate::Result;
use crate::dynamics::Linearisation;
use nalgebra::DVector;

/// Acceleration: driven joints reach their new velocity within the step, the others follow Eq. 3.
fn acceleration(
    s: &Stepper,
    e: &Linearisation,
    split: &Split,
    v: &DVector<f64>,
    control: &DVector<f64>,
) -> Result<DVector<f64>> {
    let mut driven = (&split.driven - v) / s.dt;
    for &i in &split.free {
        driven[i] = 0.0;
    }
    let right = e.inertial_force(v, control)? - &e.mass_matrix * &driven;
    let free = readout::factor(e, split)?.solve(&split.take(&right));
    Ok(driven + split.put(&free))
}

pub(super) fn step(
    s: &Stepper,
    e: &Linearisation,
    state: &State,
    v: &DVector<f64>,
    input: &Input,
) -> Result<Stepped> {
    let split = s.split(&input.hold, When::Over(s.time(state), s.dt));
    let a = acceleration(s, e, &split, v, &input.control)?;
    let free = &split.driven + split.put(&split.take(&(v + s.dt * a)));
    let next = contact::solve(e, &split, &free, s.dt, &|| stage_name(s, state))?;
    let q = advance(s, state, &next);
    let mut state = next_state(state, &split, q, next.clone(), input);
    state.y = next;
    let memo = Some(contact::kept(&free, &state.y));
    Ok(Stepped { state, memo })
}

pub(super) fn step_vjp(
    s: &Stepper,
    e: &Linearisation,
    state: &State,
    v: &DVector<f64>,
    input: &Input,
    memo: &Memo,
    next_bar: &StateBar,
) -> Result<StepBar> {
    let split = s.split(&input.hold, When::Over(s.time(state), s.dt));
    let a = acceleration(s, e, &split, v, &input.control)?;
    let (free, next) = match memo {
        Some(both) => contact::parted(both, v.len()),
        None => {
            let free = &split.driven + split.put(&split.take(&(v + s.dt * &a)));
            let next = contact::solve(e, &split, &free, s.dt, &|| stage_name(s, state))?;
            (free, next)
        }
    };
    let mut bar = StepBar::zeros(e);
    let (q_bar, mut next_v_bar) = advance_vjp(s, &split, &next, &next_bar.q);
    bar.state.q += q_bar;
    next_v_bar += &next_bar.y;
    let mut next_v_bar = contact::solve_vjp(e, &split, &free, &next, &next_v_bar, s.dt, &mut bar)?;
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
