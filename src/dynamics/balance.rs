//! The rate of the frame momenta, p̂˙ = f(q, v, u), with its tangent in v and its transpose.
//!
//! Per body, with spatial momentum h_b = h_r + h_f (rigid and fluid), current U and the fluid's pose
//! force F_b = ½ ∂E(v, v)/∂g_b, the balance is ḣ_b = F_b + (U,0) ×* h_f + the wrenches of [`super::force`];
//! projected on the frame columns, which rotate with their parent's twist,
//!
//! ```text
//! f_i = Ŝ_iᵀ Ḣ_i + (V_parent × Ŝ_i)ᵀ H_i + (X⁻ᵀ τ)_i          H, Ḣ: sums over the subtree
//! ẑᵀ f = Σ_b Z_b · ḣ_b + D_b · h_b + ẑᵀ X⁻ᵀ τ
//! ```
//!
//! Of what may drift with the water h_r is the momentum relative to its drift W, and W ×* h_r is part of ḣ_b ([`super::drift`]).
//!
//! For a joint to the world the second term vanishes, and with no external force the sum of momenta is
//! kept to round-off by any integrator that is linear in f.

use super::fluid::{self, FluidMomenta};
use super::force::{LoadBars, Loads, Moving, Place, Velocity};
use super::island_matrix::IslandMatrix;
use super::linearisation::Water;
use super::slopes::unit;
use super::{Evaluation, ForceCotangents, Linearisation, Parameters, Slopes};
use crate::Result;
use crate::adjoint::lie::{Vec6, cross_force, cross_motion, six};
use crate::adjoint::rigid;
use crate::coupling::Direction;
use crate::multibody::{Cotangents, Fields, Link, Virtual};
use nalgebra::{DMatrix, DVector, Matrix6};

/// Fields of each ẑ, cotangents of them, and of the rest.
pub(super) type Dry = (Vec<Fields>, Vec<Cotangents>, Vec<ForceCotangents>);

/// What is known of the ẑ of several transposes, and asked of them.
#[derive(Clone, Copy)]
pub(super) enum Rows {
    /// Any, with all cotangents.
    Whole,
    /// Unit vectors, which move the bodies behind one joint alone; those of the parameters perhaps.
    Units { by_parameters: bool },
}

impl Rows {
    fn units(by_parameters: bool) -> Self {
        Self::Units { by_parameters }
    }

    pub(super) fn by_parameters(self) -> bool {
        match self {
            Self::Whole => true,
            Self::Units { by_parameters } => by_parameters,
        }
    }

    /// Whether what body `b` has in them comes to nothing.
    pub(super) fn skips(self, fields: &Fields, b: usize) -> bool {
        let still = fields.virtual_twist[b] == Vec6::zeros() && fields.turning[b] == Vec6::zeros();
        matches!(self, Self::Units { .. }) && still
    }
}

/// Adds the cotangent of mass, inertia and centre of mass of body `b` for a term `x̄ᵀ M̄_r ȳ` (body-frame twists).
pub(super) fn rigid_parameters_vjp(
    e: &Evaluation,
    b: usize,
    x: &Vec6,
    y: &Vec6,
    bar: &mut Parameters,
) {
    let pose = &e.kinematics.poses[b];
    let outer: Matrix6<f64> = pose.twist_to_body(x) * pose.twist_to_body(y).transpose();
    let (mass, center) = (e.parameters.mass(b), e.parameters.center_of_mass(b));
    let found = rigid::spatial_inertia_vjp(mass, &center, &outer);
    *bar.mass_mut(b) += found.mass;
    bar.add_inertia(b, &found.inertia);
    bar.add_center_of_mass(b, &found.center);
}

impl Evaluation<'_> {
    /// The current as a spatial twist.
    pub(super) fn current_twist(&self) -> Vec6 {
        six(&self.system.current, &nalgebra::Vector3::zeros())
    }

    /// Half of the submerged bodies' field on all bodies.
    pub(super) fn half_from_submerged(&self, field: &[Vec6]) -> Vec<Vec6> {
        self.from_submerged(&field.iter().map(|w| 0.5 * w).collect::<Vec<_>>())
    }

    /// Bodies and joints as forces see them.
    pub(super) fn moving<'b>(
        &'b self,
        twists: &'b [Vec6],
        v: &'b DVector<f64>,
        control: &'b DVector<f64>,
    ) -> Moving<'b> {
        self.system.moving(self.place(), twists, v, control)
    }

    /// The same without motion.
    pub(super) fn place(&self) -> Place<'_> {
        Place {
            poses: &self.kinematics.poses,
            q: &self.q,
            time: self.time,
            parameters: self.parameters,
        }
    }

    /// What all forces do to bodies that move with spatial `twists`, but those that are solved with contact.
    pub(super) fn loads(&self, twists: &[Vec6], v: &DVector<f64>, control: &DVector<f64>) -> Loads {
        let at = self.moving(twists, v, control);
        let mut out = Loads::zeros(twists.len(), v.len());
        for force in self.system.smooth_forces() {
            force.add(&at, &mut out);
        }
        out
    }

    /// What the same are rounded by at the velocity `v`: the sum of the sizes of each one's generalised forces, user coordinates.
    pub(super) fn load_effort(&self, v: &DVector<f64>, control: &DVector<f64>) -> DVector<f64> {
        let tree = &self.system.tree;
        let twists = tree.twists(&self.kinematics, v);
        let at = self.moving(&twists, v, control);
        let mut out = DVector::zeros(v.len());
        for force in self.system.smooth_forces() {
            force.efforts(&at, &mut |add| {
                let mut loads = Loads::zeros(twists.len(), v.len());
                add(&mut loads);
                let bodies = tree.project(&self.kinematics.columns, loads.wrenches);
                out += bodies.abs() + loads.joints.abs();
            });
        }
        out
    }

    /// Transpose of [`Evaluation::loads`]: the gradient of the power on the velocity `z`, added to `bar` and `out`.
    pub(super) fn loads_vjp(
        &self,
        twists: &[Vec6],
        v: &DVector<f64>,
        control: &DVector<f64>,
        z: &Velocity,
        bar: &mut Cotangents,
        out: &mut ForceCotangents,
    ) {
        use std::slice::{from_mut, from_ref};
        let (z, bar, out) = (from_ref(z), from_mut(bar), from_mut(out));
        self.loads_vjps(twists, v, control, z, bar, out, true);
    }

    /// The same for several velocities at once; the parameters' cotangents only if they are asked for.
    #[expect(
        clippy::too_many_arguments,
        reason = "a force's own, and where they go"
    )]
    fn loads_vjps(
        &self,
        twists: &[Vec6],
        v: &DVector<f64>,
        control: &DVector<f64>,
        z: &[Velocity],
        bars: &mut [Cotangents],
        out: &mut [ForceCotangents],
        by_parameters: bool,
    ) {
        let at = self.moving(twists, v, control);
        let bars = bars.iter_mut().zip(out);
        let mut bars: Vec<LoadBars> = bars.map(|(bar, out)| out.bars(bar)).collect();
        for force in self.system.smooth_forces() {
            force.vjps(&at, z, &mut bars, by_parameters);
        }
    }

    /// Generalised forces of the same at the velocity `v`, user coordinates.
    pub(super) fn user_loads(&self, v: &DVector<f64>, control: &DVector<f64>) -> DVector<f64> {
        let tree = &self.system.tree;
        let twists = tree.twists(&self.kinematics, v);
        let Loads { wrenches, joints } = self.loads(&twists, v, control);
        tree.project(&self.kinematics.columns, wrenches) + joints
    }

    /// Transpose of [`Evaluation::user_loads`]: the gradient of their power on the velocity `z`.
    pub(super) fn user_loads_vjp(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
        z: &DVector<f64>,
    ) -> ForceCotangents {
        let tree = &self.system.tree;
        let mut out = ForceCotangents::zeros(self);
        let fields = tree.fields(&self.kinematics, &self.q, v, Virtual::User(z));
        let mut bar = Cotangents::zeros(self.system.len());
        bar.virtual_twist = self.loads(&fields.twist, v, control).wrenches;
        let power = Velocity {
            twists: &fields.virtual_twist,
            v: z,
        };
        self.loads_vjp(&fields.twist, v, control, &power, &mut bar, &mut out);
        let (q_bar, v_bar) = tree.reverse(&self.kinematics, v, Virtual::User(z), &fields, bar);
        out.q += q_bar;
        out.v += v_bar;
        out
    }

    /// Adds W ×* I (V − W), of bodies that move by `drifting` relative to W.
    fn add_drift(&self, drifting: &[Vec6], rates: &mut [Vec6]) {
        for (b, rate) in rates.iter_mut().enumerate() {
            let drift = self.system.drift.of(b);
            if *drift != Vec6::zeros() {
                *rate += cross_force(drift, &self.rigid_momentum(b, &drifting[b]));
            }
        }
    }

    /// Projects momenta and their rates on the rotating frame columns.
    fn project_frame(&self, twists: &[Vec6], momenta: Vec<Vec6>, rates: Vec<Vec6>) -> DVector<f64> {
        let tree = &self.system.tree;
        let (momenta, rates) = (tree.composite(momenta), tree.composite(rates));
        let mut out = DVector::zeros(tree.velocities());
        for (b, link) in tree.links().iter().enumerate() {
            let carried = link
                .parent
                .map_or(Vec6::zeros(), |p| cross_force(&twists[p], &momenta[b]));
            for (column, k) in link.terms() {
                out[k] += self.kinematics.frame_columns[column].dot(&(rates[b] - carried));
            }
        }
        out
    }

    /// Derivative of `X(q)ᵀ p̂` with respect to q, nv × nv.
    pub(super) fn frame_momentum_slope(&self, hat: &DVector<f64>) -> DMatrix<f64> {
        let row = |l: &Link, v: &[f64]| [l.joint.frame_velocity_vjp(v, l.of_v(hat))];
        let [out] = self.system.tree.blocks(row);
        out
    }

    /// Gradient over q of `p̂ᵀ X(q) v`, joint by joint.
    pub(super) fn frame_velocity_vjp(&self, v: &DVector<f64>, hat: &DVector<f64>) -> DVector<f64> {
        let part = |l: &Link| l.joint.frame_velocity_vjp(l.of_v(v), l.of_v(hat));
        let [out] = self.system.tree.joints(|l| [part(l)]);
        out
    }
}

impl Linearisation<'_> {
    /// Fluid pose forces `½ ∂E(v, v)/∂g` on all bodies at unit density; zeros where no water acts.
    pub(super) fn pose_force(&self, direction: &DVector<f64>) -> Result<Vec<Vec6>> {
        Ok(match self.acting() {
            Some(water) => {
                self.half_from_submerged(&water.linearised.gradient(direction, direction)?)
            }
            None => vec![Vec6::zeros(); self.system.len()],
        })
    }

    /// Momenta of all bodies, and the wrenches that change them, as the water moved by the submerged bodies' `field` answers in the
    /// direction `other`.
    pub(super) fn respond(
        &self,
        water: &Water,
        field: &[Vec6],
        other: Direction,
    ) -> Result<(Vec<Vec6>, Vec<Vec6>)> {
        let none = || vec![Vec6::zeros(); field.len()];
        if let FluidMomenta::Apart(added) = water.fluid {
            let momenta = fluid::apart(added, self.system, &self.kinematics, field);
            return Ok((momenta, none()));
        }
        let submerged = self.submerged_twists(field);
        if submerged.iter().all(|x| *x == 0.0) {
            return Ok((none(), none()));
        }
        let pullback = (water.linearised).vjp(Direction::Twist(&submerged), other)?;
        Ok((
            self.submerged_impulses(&pullback.momentum_x),
            self.from_submerged(&pullback.wrench),
        ))
    }

    /// f(q, v, u).
    ///
    /// # Errors
    /// A coupling that fails.
    pub fn force(&self, v: &DVector<f64>, control: &DVector<f64>) -> Result<DVector<f64>> {
        let twists = self.system.tree.twists(&self.kinematics, v);
        self.force_with(v, &twists, self.loads(&twists, v, control))
    }

    /// The same with `loads` for all forces but those of the motion itself, at the spatial `twists` of v.
    pub(super) fn force_with(
        &self,
        v: &DVector<f64>,
        twists: &[Vec6],
        mut loads: Loads,
    ) -> Result<DVector<f64>> {
        let rho = self.parameters.density();
        let direction = self.through_water(v);
        let fluid = self.fluid_momenta(&direction);
        let pose_force = self.pose_force(&direction)?;
        let current = self.current_twist();
        let drifting = self.drifting(twists);
        for (b, rate) in loads.wrenches.iter_mut().enumerate() {
            *rate += rho * (pose_force[b] + cross_force(&current, &fluid[b]));
        }
        self.add_drift(&drifting, &mut loads.wrenches);
        let momenta = self.with_rigid(&drifting, &fluid);
        let out = self.project_frame(twists, momenta, loads.wrenches);
        Ok(out + self.frame_dual(&loads.joints))
    }

    /// Tangents of [`Linearisation::force`] along `changes` of v at fixed q and u, each with the change of the fluid's pose force on the
    /// submerged bodies, if there is any.
    fn force_jvp(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
        changes: &[DVector<f64>],
        dpose_forces: &[Vec<Vec6>],
    ) -> Vec<DVector<f64>> {
        let tree = &self.system.tree;
        let rho = self.parameters.density();
        let twists = tree.twists(&self.kinematics, v);
        let fluid = self.fluid_momenta(&self.through_water(v));
        let momenta = self.with_rigid(&self.drifting(&twists), &fluid);
        let current = self.current_twist();
        let none = vec![Vec6::zeros(); twists.len()];
        let along: Vec<Vec<Vec6>> = (changes.iter())
            .map(|dv| tree.twists(&self.kinematics, dv))
            .collect();
        let velocities: Vec<Velocity> = (changes.iter().zip(&along))
            .map(|(v, twists)| Velocity { twists, v })
            .collect();
        let mut dloads: Vec<Loads> = (changes.iter())
            .map(|_| Loads::zeros(twists.len(), v.len()))
            .collect();
        let at = self.moving(&twists, v, control);
        for force in self.system.smooth_forces() {
            force.jvps(&at, &velocities, &mut dloads);
        }
        let each = changes.iter().zip(&along).zip(dloads).zip(dpose_forces);
        each.map(|(((dv, dtwists), mut dloads), dpose_force)| {
            let dfluid = self.fluid_momenta(&self.virtual_direction(dv));
            let dpose_force = match dpose_force.is_empty() {
                false => self.from_submerged(dpose_force),
                true => none.clone(),
            };
            for (b, drate) in dloads.wrenches.iter_mut().enumerate() {
                *drate += rho * (dpose_force[b] + cross_force(&current, &dfluid[b]));
            }
            self.add_drift(dtwists, &mut dloads.wrenches);
            let dmomenta = self.with_rigid(dtwists, &dfluid);
            let out = self.project_frame(&twists, dmomenta, dloads.wrenches)
                + self.project_frame(dtwists, momenta.clone(), none.clone());
            match dloads.joints.iter().all(|x| *x == 0.0) {
                true => out,
                false => out + self.frame_dual(&dloads.joints),
            }
        })
        .collect()
    }

    /// ∂f/∂v.
    ///
    /// # Errors
    /// As [`Linearisation::force`].
    pub fn force_velocity_jacobian(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
    ) -> Result<DMatrix<f64>> {
        Ok(self.force_velocity_blocks(v, control)?.dense())
    }

    /// The same by islands.
    pub(super) fn force_velocity_blocks(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
    ) -> Result<IslandMatrix> {
        let islands = self.islands_of_all();
        let changes = islands.changes();
        let changed = match (self.acting(), &self.fluid) {
            (Some(water), FluidMomenta::Coupled(_) | FluidMomenta::Scattered(_)) => {
                (water.linearised).gradient_columns(&self.through_water(v))?
            }
            _ => vec![Vec::new(); changes.len()],
        };
        let found = self.force_jvp(v, control, &changes, &changed);
        Ok(IslandMatrix::new(islands, &found))
    }

    /// Transpose of [`Linearisation::force`] in all its arguments: the gradient of `ẑᵀ f(q, v, u)`.
    ///
    /// # Errors
    /// A solve of the coupling that misses its tolerance.
    pub fn force_vjp(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
        z: &DVector<f64>,
    ) -> Result<ForceCotangents> {
        let mut all = self.force_vjps(v, control, std::slice::from_ref(z), Rows::Whole)?;
        Ok(all.pop().unwrap_or_else(|| ForceCotangents::zeros(self)))
    }

    /// Derivatives of the entries `entries` of [`Linearisation::force`], those with respect to the parameters if they are asked for; the others have none.
    ///
    /// # Errors
    /// As [`Linearisation::force_vjp`].
    pub fn force_slopes(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
        entries: &[usize],
        by_parameters: bool,
    ) -> Result<Slopes> {
        let units: Vec<_> = entries.iter().map(|i| unit(v.len(), *i)).collect();
        let rows = self.force_vjps(v, control, &units, Rows::units(by_parameters))?;
        let zero = ForceCotangents::zeros(self);
        Ok(Slopes::from_rows(v.len(), entries, &rows, &zero))
    }

    /// The transpose for several ẑ at once.
    fn force_vjps(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
        z: &[DVector<f64>],
        rows: Rows,
    ) -> Result<Vec<ForceCotangents>> {
        let tree = &self.system.tree;
        let Some((fields, mut bars, mut out)) = self.dry_vjps(v, control, z, rows) else {
            return Ok(Vec::new());
        };
        self.fluid_force_vjps(v, &fields, &mut bars, &mut out, rows)?;
        for (((z, fields), bar), out) in z.iter().zip(&fields).zip(bars).zip(&mut out) {
            let (q_bar, v_bar) = tree.reverse(&self.kinematics, v, Virtual::Frame(z), fields, bar);
            out.q += q_bar;
            out.v += v_bar;
        }
        Ok(out)
    }

    /// All of it but the water's part; none of none.
    pub(super) fn dry_vjps(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
        z: &[DVector<f64>],
        rows: Rows,
    ) -> Option<Dry> {
        let (tree, n) = (&self.system.tree, self.system.len());
        let first = z.first()?;
        let field = |z| Virtual::Frame(z);
        let mut fields = vec![tree.fields(&self.kinematics, &self.q, v, field(first))];
        for z in &z[1..] {
            let next = tree.with_virtual(&self.kinematics, &self.q, &fields[0], field(z));
            fields.push(next);
        }
        let twist = &fields[0].twist;
        let drifting = self.drifting(twist);
        let momenta = drifting.iter().enumerate();
        let momenta: Vec<Vec6> = momenta.map(|(b, v)| self.rigid_momentum(b, v)).collect();
        let loads = self.loads(twist, v, control);
        let mut out = vec![ForceCotangents::zeros(self); z.len()];
        let mut bars = vec![Cotangents::zeros(n); z.len()];
        for ((fields, bar), out) in fields.iter().zip(&mut bars).zip(&mut out) {
            for (b, turning) in fields.turning.iter().enumerate() {
                if rows.skips(fields, b) {
                    continue;
                }
                // (D − W × Z) · h_r, with the rigid momentum h_r = I (V − W), I constant in the body's frame.
                let (drift, relative) = (self.system.drift.of(b), &drifting[b]);
                let turning = &(turning - cross_motion(drift, &fields.virtual_twist[b]));
                let (h, h_turning) = (momenta[b], self.rigid_momentum(b, turning));
                bar.turning[b] += h;
                bar.virtual_twist[b] += cross_force(drift, &h);
                bar.twist[b] += h_turning;
                bar.pose[b] -= cross_force(relative, &h_turning) + cross_force(turning, &h);
                if rows.by_parameters() {
                    rigid_parameters_vjp(self, b, turning, relative, &mut out.parameters);
                }
            }
            // Z · wrenches + ẑᵀ X⁻ᵀ τ.
            for (bar, wrench) in bar.virtual_twist.iter_mut().zip(&loads.wrenches) {
                *bar += wrench;
            }
        }
        let tau_bars: Vec<_> = z.iter().map(|z| self.frame_velocity_inverse(z)).collect();
        let powers = fields.iter().zip(&tau_bars);
        let powers: Vec<Velocity> = powers
            .map(|(fields, v)| Velocity {
                twists: &fields.virtual_twist,
                v,
            })
            .collect();
        let by_parameters = rows.by_parameters();
        self.loads_vjps(
            twist,
            v,
            control,
            &powers,
            &mut bars,
            &mut out,
            by_parameters,
        );
        let joints = self.frame_dual(&loads.joints);
        for (out, tau_bar) in out.iter_mut().zip(&tau_bars) {
            out.q -= self.frame_velocity_vjp(tau_bar, &joints);
        }
        Some((fields, bars, out))
    }
}
