//! Explicit Runge–Kutta methods in (chart of q, p̂) whose stages each lean on the one before: the midpoint rule
//! (second order) and the classical method (fourth order).
//!
//! Rotations are integrated in a rotation-vector chart around the start of the step, whose rate is
//! the inverse left Jacobian times the angular velocity, so the order isn't lost on the group.

use super::euler::next_state;
use super::{
    Input, Integrator, Memo, Split, State, StateBar, StepBar, Stepped, Stepper, When, readout,
};
use crate::Result;
use crate::dynamics::Linearisation;
use nalgebra::DVector;

/// Nodes and weights of a method; stage i starts from stage i − 1 over `nodes[i]` of the step.
struct Tableau {
    nodes: &'static [f64],
    weights: &'static [f64],
}

/// The explicit midpoint rule.
const SECOND: Tableau = Tableau {
    nodes: &[0.0, 0.5],
    weights: &[0.0, 1.0],
};

/// The classical method.
const FOURTH: Tableau = Tableau {
    nodes: &[0.0, 0.5, 0.5, 1.0],
    weights: &[1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
};

/// The stepper's method.
fn tableau(s: &Stepper) -> &'static Tableau {
    match s.integrator {
        Integrator::Rk2 => &SECOND,
        _ => &FOURTH,
    }
}

struct Stage<'a> {
    /// The first stage has none: it is the step's own.
    evaluation: Option<Linearisation<'a>>,
    split: Split,
    xi: DVector<f64>,
    p: DVector<f64>,
    v: DVector<f64>,
    /// Whether v is the velocity read out at the state.
    read_out: bool,
    chart_rate: DVector<f64>,
    force: DVector<f64>,
}

impl<'a> Stage<'a> {
    fn at<'e>(&'e self, e: &'e Linearisation<'a>) -> &'e Linearisation<'a> {
        self.evaluation.as_ref().unwrap_or(e)
    }
}

/// The stages; made `again` for the reverse sweep, with the forces kept from the step: that of the last stage
/// isn't asked for there.
fn stages<'a>(
    s: &Stepper<'a>,
    e: &Linearisation<'a>,
    state: &State,
    v: &DVector<f64>,
    input: &Input,
    start: &DVector<f64>,
    again: Option<&Memo>,
) -> Result<Vec<Stage<'a>>> {
    let tree = &s.system.tree;
    let nv = tree.velocities();
    let mut out: Vec<Stage> = Vec::with_capacity(tableau(s).nodes.len());
    for (i, node) in tableau(s).nodes.iter().enumerate() {
        let t = s.time(state) + node * s.dt;
        let split = s.split(&input.hold, When::At(t));
        let (xi, p) = match out.last() {
            Some(last) => (
                node * s.dt * &last.chart_rate,
                start + node * s.dt * &last.force,
            ),
            None => (DVector::zeros(nv), start.clone()),
        };
        let evaluation = if i == 0 {
            None
        } else {
            let mut q = tree.integrate(&state.q, &xi);
            s.place_motions(&mut q, t);
            Some(s.system.linearise(s.parameters, &q)?)
        };
        let at = evaluation.as_ref().unwrap_or(e);
        // The readout's, unless a joint is newly held or released.
        let read_out = i == 0 && split.is_driven == s.split(&state.held, When::At(t)).is_driven;
        let stage_v = if read_out {
            v.clone()
        } else {
            readout::solve(at, &split, &p)?
        };
        let chart_rate = tree.chart_rate(&xi, &stage_v);
        let force = match again {
            Some(_) if i + 1 == tableau(s).nodes.len() => DVector::zeros(nv),
            Some(Some(kept)) => kept.rows(i * nv, nv).into_owned(),
            _ => at.force(&stage_v, &input.control)?,
        };
        out.push(Stage {
            evaluation,
            split,
            xi,
            p,
            v: stage_v,
            read_out,
            chart_rate,
            force,
        });
    }
    Ok(out)
}

pub(super) fn step<'a>(
    s: &Stepper<'a>,
    e: &Linearisation<'a>,
    state: &State,
    v: &DVector<f64>,
    input: &Input,
) -> Result<Stepped> {
    let first = s.split(&input.hold, When::At(s.time(state)));
    let start = s.released_momentum(e, state, v, &first);
    let stages = stages(s, e, state, v, input, &start, None)?;
    let mut xi = DVector::zeros(v.len());
    let mut y = start;
    for (stage, weight) in stages.iter().zip(tableau(s).weights) {
        xi += *weight * s.dt * &stage.chart_rate;
        y += *weight * s.dt * &stage.force;
    }
    let mut q = s.system.tree.integrate(&state.q, &xi);
    s.place_motions(&mut q, (state.step + 1) as f64 * s.dt);
    let leant_on = &stages[..stages.len() - 1];
    let kept = leant_on
        .iter()
        .flat_map(|stage| stage.force.iter().copied());
    let kept = DVector::from_iterator(leant_on.len() * v.len(), kept);
    Ok(Stepped {
        state: next_state(state, &first, q, y, input),
        memo: Some(kept),
    })
}

pub(super) fn step_vjp<'a>(
    s: &Stepper<'a>,
    e: &Linearisation<'a>,
    state: &State,
    v: &DVector<f64>,
    input: &Input,
    memo: &Memo,
    next_bar: &StateBar,
) -> Result<StepBar> {
    let tree = &s.system.tree;
    let first = s.split(&input.hold, When::At(s.time(state)));
    let start = s.released_momentum(e, state, v, &first);
    let stages = stages(s, e, state, v, input, &start, Some(memo))?;
    let mut xi = DVector::zeros(v.len());
    for (stage, weight) in stages.iter().zip(tableau(s).weights) {
        xi += *weight * s.dt * &stage.chart_rate;
    }
    let mut bar = StepBar::zeros(e);
    let mut q_bar = next_bar.q.clone();
    first.forget_moved(&mut q_bar);
    let (q_direct, xi_bar) = tree.integrate_vjp(&xi, &q_bar);
    bar.state.q += q_direct;
    let mut y_bar = next_bar.y.clone();
    first.forget_driven(&mut y_bar);
    let mut start_bar = y_bar.clone();
    let spread = |bar: &DVector<f64>| -> Vec<DVector<f64>> {
        tableau(s).weights.iter().map(|w| *w * s.dt * bar).collect()
    };
    let (mut rate_bar, mut force_bar) = (spread(&xi_bar), spread(&y_bar));
    for i in (0..stages.len()).rev() {
        let stage = &stages[i];
        let e = stage.at(e);
        let mut own = StepBar::zeros(e);
        let (mut stage_xi_bar, mut v_bar) = tree.chart_rate_vjp(&stage.xi, &stage.v, &rate_bar[i]);
        let force = e.force_vjp(&stage.v, &input.control, &force_bar[i])?;
        own.add(1.0, &force);
        v_bar += &force.v;
        if stage.read_out {
            bar.v += &v_bar;
        } else {
            readout::solve_vjp(e, &stage.split, &stage.p, &stage.v, &v_bar, &mut own)?;
        }
        stage.split.forget_moved(&mut own.state.q);
        let (q_bar, xi_bar) = tree.integrate_vjp(&stage.xi, &own.state.q);
        bar.state.q += q_bar;
        stage_xi_bar += xi_bar;
        bar.control += own.control;
        bar.parameters.add(&own.parameters);
        start_bar += &own.state.y;
        if i > 0 {
            let h = tableau(s).nodes[i] * s.dt;
            rate_bar[i - 1] += h * stage_xi_bar;
            force_bar[i - 1] += h * &own.state.y;
        }
    }
    first.forget_driven(&mut start_bar);
    s.released_momentum_vjp(e, state, v, &first, &start_bar, &mut bar)?;
    Ok(bar)
}
