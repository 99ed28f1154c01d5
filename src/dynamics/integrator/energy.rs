//! The end of a step brought to the kinetic energy that it should have: that at its start, and the work of the forces.
//!
//! Between two configurations the inertia changes, and what a step of first order makes of that gains or loses energy. With the state (q⁺, p̂*) that the
//! step ends in, v* = M(q⁺)⁻¹ p*, and the velocities v₀ at its start, v before contact and v_e with which it acts, the defect is
//!
//! ```text
//! δ = ½ v*ᵀ M(q⁺) v* − ½ v₀ᵀ M(q) v₀ − ½ Δt F(q, v)ᵀ (v₀ + v + v* − v_e) − ½ Δt g(q, v_e)ᵀ (v + v_e)
//! ```
//!
//! F being all forces but the water's inertia, g those of contact, with what resists motion otherwise than at v; all velocities relative to the drift where there is a current ([`crate::dynamics::Drift`]). It is zero where the inertia stays what it is, whatever acts:
//! forces take v₀ to v then, contact v to v_e = v*. It is taken out of e = v* − B ω, the motion
//! but for the rigid one B ω of all bodies together that nothing in the water or the joints stands against ([`System::symmetric`](crate::dynamics::System)), which holds
//! the momentum along B:
//!
//! ```text
//! p̂⁺ = p̂* + (s − 1) X⁻ᵀ M(q⁺) e      s² = 1 − c(φ χ δ / ½ eᵀ M(q⁺) e)      (Bᵀ M B) ω = Bᵀ p*
//! ```
//!
//! A motion of B that would move a joint that is held isn't one of all bodies together, and isn't among them.
//!
//! c is the identity up to ¼ and bounded by ½. φ = 10⁻⁴ |v|²_M / (10⁻⁴ |v|²_M + |v_e − v|²_M) fades out where contact takes speed: an impact loses more than this accounts for.
//! χ fades out where e has less than a hundredth of the energy, from a thousandth on to nothing: what the motion of all together gains or loses would be all that a light rotor has.
//!
//! This is a projection on the energy (Hairer, Lubich, Wanner, "Geometric Numerical Integration", IV.4) in the one direction that keeps momenta.

use super::reaction::{Reaction, Resisting};
use super::stages::ContactVelocities;
use super::start::Start;
use super::{State, StateBar, StateTangents, StepBar, StepTangents, readout};
use crate::adjoint::solve::Definite;
use crate::dynamics::slopes::columns;
use crate::dynamics::{Dual, Evaluation, Linearisation, Motions};
use crate::error::in_order;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Part of the kinetic energy that contact takes at which the correction is halved.
const FADE: f64 = 1e-4;
/// Part of the energy that e has from which on it takes all of a defect, and up to which none.
const ENOUGH: f64 = 1e-2;
const TOO_LITTLE: f64 = 1e-3;
/// Part of the energy of e up to which a defect is taken as it is.
const WHOLE: f64 = 0.25;

/// c and its derivative.
fn bounded(x: f64) -> (f64, f64) {
    if x.abs() <= WHOLE {
        return (x, 1.0);
    }
    let over = ((x.abs() - WHOLE) / WHOLE).tanh();
    (x.signum() * (WHOLE + WHOLE * over), 1.0 - over * over)
}

/// χ of the part of the energy that e has, and its derivative.
fn share(part: f64) -> (f64, f64) {
    let x = (part - TOO_LITTLE) / (ENOUGH - TOO_LITTLE);
    match x {
        x if x <= 0.0 => (0.0, 0.0),
        x if x >= 1.0 => (1.0, 0.0),
        x => (
            x * x * x * (10.0 + x * (6.0 * x - 15.0)),
            30.0 * x * x * (1.0 - x) * (1.0 - x) / (ENOUGH - TOO_LITTLE),
        ),
    }
}

/// B, of a step that can be closed: in still water or where all may drift with it, of joints that nothing drives, and with some motion beside that of all bodies together. What would move a
/// joint that is held isn't of it.
fn common(start: &Start) -> Option<Motions> {
    let (s, split) = (start.stepper, start.split);
    let common = s.system.symmetric.sparing(&split.is_driven);
    let drift = &s.system.drift;
    let still = &split.driven - drift.velocity();
    let mut driven = split.is_driven.iter().zip(still.iter());
    let closes = drift.is_whole()
        && common.len() < split.free.len()
        && !split.moved.contains(&true)
        && driven.all(|(driven, v)| !driven || *v == 0.0)
        && s.split_at(start.state).is_driven == split.is_driven;
    closes.then_some(common)
}

/// Velocities of a step relative to the drift.
struct Drifting {
    start: DVector<f64>,
    before: DVector<f64>,
    acting: DVector<f64>,
}

impl Drifting {
    fn new(start: &Start, velocities: &ContactVelocities) -> Self {
        let w = start.stepper.system.drift.velocity();
        Self {
            start: start.v - w,
            before: &velocities.before - w,
            acting: velocities.acting() - w,
        }
    }

    /// v₀ + v + v* − v_e: twice the mean velocity that forces do work at in a step that ends at v*; where nothing presses v₀ + v*.
    fn path(&self, end: &DVector<f64>) -> DVector<f64> {
        &self.start + end + (&self.before - &self.acting)
    }
}

/// All that the correction consists of.
struct Parts {
    /// Velocity at the end, before the correction, relative to the drift.
    v: DVector<f64>,
    /// B.
    basis: Motions,
    /// Motion of all bodies together, user's coordinates.
    together: DVector<f64>,
    /// Bᵀ M B.
    common: Option<Definite>,
    /// M(q⁺) e in frame coordinates.
    direction: DVector<f64>,
    /// ½ eᵀ M e, and ½ v*ᵀ M v*.
    room: f64,
    kinetic: f64,
    /// F, user's coordinates.
    loads: DVector<f64>,
    /// g.
    contact: Option<DVector<f64>>,
    /// Kinetic energy of the velocity before contact, and of what contact takes of it.
    before: f64,
    lost: f64,
    /// φ.
    fade: f64,
    defect: f64,
}

impl Parts {
    /// Of the step with these velocities that ends at `end` with the frame momenta `hat`; none where there is nothing to take energy from.
    fn new(
        start: &Start,
        basis: Motions,
        velocities: &ContactVelocities,
        end: &Evaluation,
        hat: &DVector<f64>,
    ) -> Result<Option<Self>> {
        let (s, e, near, split) = (start.stepper, start.e, start.near, start.split);
        let reaction = Reaction::new(start, &velocities.before, Resisting::AtStart);
        let drifting = Drifting::new(start, velocities);
        let (before, acting) = (&drifting.before, &drifting.acting);
        let v = readout::solve(end, split, hat)? - s.system.drift.velocity();
        let (mut together, mut common, mut direction) =
            (DVector::zeros(v.len()), None, hat.clone());
        if !basis.is_empty() {
            let user = columns(&basis.dense(), |b| end.frame_velocity_inverse(b));
            let momenta = columns(&user, |v| end.mass_times(v));
            let matrix = user.tr_mul(&momenta);
            let matrix = Definite::new(0.5 * (&matrix + matrix.transpose())).ok_or_else(|| {
                Error::Solver {
                    what: start.stage_name(),
                    iterations: 0,
                    residual: f64::INFINITY,
                    tolerance: 0.0,
                    remedy: "the mass matrix isn't positive definite: take a smaller time step"
                        .into(),
                }
            })?;
            let omega = matrix.solve(&basis.tr_mul(hat));
            together = &user * &omega;
            direction -= end.frame_dual(&(momenta * omega));
            common = Some(matrix);
        }
        let room = end.mass_energy(&(&v - &together));
        let kinetic = end.mass_energy(&v);
        if room.is_nan() || room <= 1e-9 * kinetic {
            return Ok(None);
        }
        let loads = e.user_loads(&velocities.before, &start.input.control);
        let first = &drifting.start;
        let path = drifting.path(&v);
        let mut defect = kinetic - e.mass_energy(first) - 0.5 * s.dt * loads.dot(&path);
        let contact = near
            .contact_acts(&velocities.before)
            .then(|| reaction.force(velocities.acting(), Dual::User));
        let speed = e.mass_energy(before);
        let mut lost = 0.0;
        if let Some(g) = &contact {
            defect -= 0.5 * s.dt * g.dot(&(before + acting));
            lost = e.mass_energy(&(acting - before)).max(0.0);
        }
        Ok(Some(Self {
            v,
            basis,
            together,
            common,
            direction,
            room,
            kinetic,
            loads,
            contact,
            before: speed,
            lost,
            fade: match lost > 0.0 {
                true => FADE * speed / (FADE * speed + lost),
                false => 1.0,
            },
            defect,
        }))
    }

    /// s − 1.
    fn change(&self) -> f64 {
        let taken = bounded(self.ratio()).0;
        (1.0 - taken).sqrt() - 1.0
    }

    /// χ and its derivative by the part of the energy that e has.
    fn share(&self) -> (f64, f64) {
        share(self.room / self.kinetic)
    }

    /// φ χ δ / ½ eᵀ M e.
    fn ratio(&self) -> f64 {
        self.fade * self.share().0 * self.defect / self.room
    }
}

/// The state after the correction of a step that ends in `next`.
pub(super) fn close(
    start: &Start,
    velocities: &ContactVelocities,
    mut next: State,
) -> Result<State> {
    let Some(basis) = common(start) else {
        return Ok(next);
    };
    let s = start.stepper;
    let end = s
        .system
        .evaluate_apart(s.parameters, &next.q, s.time(&next))?;
    if let Some(parts) = Parts::new(start, basis, velocities, &end, &next.y)? {
        let mut change = parts.change() * &parts.direction;
        start.split.forget_driven(&mut change);
        next.y += change;
    }
    Ok(next)
}

/// What the derivatives of [`close`] need.
pub(super) struct Closure<'a> {
    end: Linearisation<'a>,
    hat: DVector<f64>,
    parts: Parts,
}

/// Cotangents of what a correction was made from, beside those that are added to a step's own.
pub(super) struct ClosureBar {
    /// Of the state before the correction.
    pub next: StateBar,
    /// Of the velocity before contact, and of the one with which it acts.
    pub velocities: [DVector<f64>; 2],
}

impl<'a> Closure<'a> {
    /// Of a step that ends in `next` before the correction; none where there is none.
    pub fn new(
        start: &Start<'_, 'a>,
        velocities: &ContactVelocities,
        next: &State,
    ) -> Result<Option<Self>> {
        let Some(basis) = common(start) else {
            return Ok(None);
        };
        let s = start.stepper;
        let end = s
            .system
            .linearise_apart(s.parameters, &next.q, s.time(next))?;
        let parts = Parts::new(start, basis, velocities, &end, &next.y)?;
        Ok(parts.map(|parts| Self {
            end,
            hat: next.y.clone(),
            parts,
        }))
    }

    /// Tangents of the momenta that [`close`] ends with, from those of the state before it, of the velocity before contact and of the one with which it acts: its
    /// entries' transposes, which are as many as there are velocities.
    pub fn jvp(
        &self,
        start: &Start<'_, 'a>,
        velocities: &ContactVelocities,
        along: &StepTangents,
        next: &StateTangents,
        [before, acting]: [&DMatrix<f64>; 2],
    ) -> Result<DMatrix<f64>> {
        let nv = start.v.len();
        let row = |i: &usize| {
            let mut bar = StepBar::zeros(start.e);
            let entry = StateBar::unit(nv, nv + i);
            let own = self.vjp(start, velocities, &entry, &mut bar)?;
            let [before_bar, acting_bar] = &own.velocities;
            Ok(bar.along(along)
                + next.q.tr_mul(&own.next.q)
                + next.y.tr_mul(&own.next.y)
                + before.tr_mul(before_bar)
                + acting.tr_mul(acting_bar))
        };
        let free = &start.split.free;
        // What answers are known when another is asked for is the same for any number of threads.
        let rows: Vec<_> = match start.e.system.coupling.scattering() {
            Some(_) => free.iter().map(row).collect::<Result<_>>()?,
            None => in_order(free.par_iter().map(row))?,
        };
        let mut out = DMatrix::zeros(nv, next.y.ncols());
        for (i, row) in start.split.free.iter().zip(rows) {
            out.row_mut(*i).tr_copy_from(&row);
        }
        Ok(out)
    }

    /// Transpose of [`close`]: cotangents of the start, the control and the parameters are added to `bar`.
    pub fn vjp(
        &self,
        start: &Start<'_, 'a>,
        velocities: &ContactVelocities,
        next_bar: &StateBar,
        bar: &mut StepBar,
    ) -> Result<ClosureBar> {
        let (s, e, parts) = (start.stepper, start.e, &self.parts);
        let drifting = Drifting::new(start, velocities);
        let (first, before, acting) = (&drifting.start, &drifting.before, &drifting.acting);
        let end = &self.end;
        let nv = before.len();
        let mut out = ClosureBar {
            next: next_bar.clone(),
            velocities: [DVector::zeros(nv), DVector::zeros(nv)],
        };
        let hat_bar = start.next_momentum_bar(next_bar);
        // Of s − 1, and of the direction.
        let change = parts.change();
        let change_bar = hat_bar.dot(&parts.direction);
        let direction_bar = change * hat_bar;
        let slope = bounded(parts.ratio()).1;
        let ratio_bar = -0.5 * slope / (1.0 + change) * change_bar;
        let (share, share_slope) = parts.share();
        let defect_bar = parts.fade * share * ratio_bar / parts.room;
        let fade_bar = share * parts.defect * ratio_bar / parts.room;
        let part_bar = share_slope * parts.fade * parts.defect * ratio_bar / parts.room;
        let room_bar = part_bar / parts.kinetic - parts.ratio() * ratio_bar / parts.room;
        let kinetic_bar = -part_bar * parts.room / (parts.kinetic * parts.kinetic);

        // The direction p̂* − M B ω, and ½ eᵀ M e = ½ v*ᵀ M v* − ½ ωᵀ Bᵀ M B ω.
        let mut at_end = StepBar::zeros(end);
        let mut hat_star_bar = direction_bar.clone();
        let mut across = end.frame_velocity_inverse(&direction_bar);
        let v_hat = end.frame_velocity(&parts.v);
        let whole_bar = defect_bar + room_bar + kinetic_bar;
        hat_star_bar += whole_bar * &v_hat;
        self.inertia_vjp(-0.5 * whole_bar, &parts.v, &parts.v, &mut at_end)?;
        if let Some(common) = &parts.common {
            let basis = &parts.basis;
            let moved = end.frame_dual(&end.mass_times(&across));
            let eta = common.solve(&basis.tr_mul(&moved));
            let carried = basis.mul(&eta);
            hat_star_bar -= &carried;
            across -= end.frame_velocity_inverse(&carried);
            self.inertia_vjp(-1.0, &across, &parts.together, &mut at_end)?;
            hat_star_bar -= room_bar * end.frame_velocity(&parts.together);
            let together = &parts.together;
            self.inertia_vjp(0.5 * room_bar, together, together, &mut at_end)?;
        }
        // The work of the forces.
        let half = 0.5 * s.dt;
        let v_bar = -defect_bar * half * &parts.loads;
        let end_velocity = &parts.v + s.system.drift.velocity();
        readout::solve_vjp(
            end,
            start.split,
            &self.hat,
            &end_velocity,
            &v_bar,
            &mut at_end,
        )?;
        hat_star_bar += &at_end.state.y;
        let along = half * drifting.path(&parts.v);
        let work = e.user_loads_vjp(&velocities.before, &start.input.control, &along);
        bar.add(-defect_bar, &work);
        let worked = defect_bar * half * &parts.loads;
        out.velocities[0] -= defect_bar * &work.v + &worked;
        out.velocities[1] += &worked;
        bar.v -= worked;
        // The energy at the start.
        bar.v -= defect_bar * e.mass_times(first);
        bar.add(-0.5 * defect_bar, &e.mass_vjp(first, first)?);
        if let Some(g) = &parts.contact {
            let along = half * (before + acting);
            let reaction = Reaction::new(start, &velocities.before, Resisting::AtStart);
            let work = reaction.force_vjp(velocities.acting(), &along, Dual::User);
            bar.add(-defect_bar, &work.force);
            out.velocities[0] -= defect_bar * (half * g + &work.before);
            out.velocities[1] -= defect_bar * (half * g + &work.force.v);
            if parts.lost > 0.0 {
                let lost = acting - before;
                // Of both energies; finite where nothing moved before.
                let sum = FADE * parts.before + parts.lost;
                let lost_bar = -FADE * parts.before / (sum * sum) * fade_bar;
                let before_bar = FADE * parts.lost / (sum * sum) * fade_bar;
                let moved = lost_bar * e.mass_times(&lost);
                out.velocities[0] += before_bar * e.mass_times(before) - &moved;
                out.velocities[1] += moved;
                bar.add(0.5 * lost_bar, &e.mass_vjp(&lost, &lost)?);
                bar.add(0.5 * before_bar, &e.mass_vjp(before, before)?);
            }
        }
        out.next.y += hat_star_bar;
        out.next.q += at_end.state.q;
        bar.parameters.add(&at_end.parameters);
        Ok(out)
    }

    /// Adds the cotangents of `scale` x̂ᵀ M̂ ŷ at the end, M̂ = X⁻ᵀ M X⁻¹ being the inertia of frame velocities, x̂ and ŷ held; x and y are the user's.
    fn inertia_vjp(
        &self,
        scale: f64,
        x: &DVector<f64>,
        y: &DVector<f64>,
        out: &mut StepBar,
    ) -> Result<()> {
        let end = &self.end;
        out.add(scale, &end.mass_vjp(y, x)?);
        for (a, b) in [(x, y), (y, x)] {
            let momentum = end.frame_dual(&end.mass_times(b));
            out.state.q -= scale * end.frame_velocity_vjp(a, &momentum);
        }
        Ok(())
    }
}
