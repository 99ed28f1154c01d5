//! Generalised momentum p = M(q) v + p_rest(q) and its transpose.

use super::balance::rigid_parameters_vjp;
use super::linearisation::Water;
use super::shape::Bilinear;
use super::slopes::unit;
use super::{Evaluation, ForceCotangents, Linearisation, Slopes};
use crate::Result;
use crate::adjoint::lie::{Vec6, cross_force};
use crate::multibody::{Cotangents, Fields, Virtual};
use nalgebra::{DMatrix, DVector};

/// Two velocities whose product with the inertia is differentiated: v with its fields, and w.
pub(super) struct Pair<'p> {
    pub fields: &'p Fields,
    pub v: &'p DVector<f64>,
    pub w: DVector<f64>,
    /// Whether w is a unit vector, which moves the bodies behind one joint alone.
    pub is_unit: bool,
    pub by_parameters: bool,
}

impl Pair<'_> {
    /// Whether what a body has in it comes to nothing, from its virtual twist.
    fn skips(&self, virt: &Vec6) -> bool {
        self.is_unit && *virt == Vec6::zeros()
    }
}

impl Evaluation<'_> {
    /// Generalised momentum at velocity `v`, user coordinates (kg m/s, kg m²/s); of what may drift with the water that relative to its drift
    /// ([`Drift`](super::Drift)).
    pub fn momentum(&self, v: &DVector<f64>) -> DVector<f64> {
        self.mass_times(v) + &self.rest_momentum
    }

    /// What it lacks where bodies may drift: Σ Jᵀ I W, the momentum of the bodies' own masses that drift.
    pub(super) fn drift_momentum(&self) -> DVector<f64> {
        let drift = &self.system.drift;
        let wrenches = (0..self.system.len())
            .map(|b| self.rigid_momentum(b, drift.of(b)))
            .collect();
        self.system.tree.project(&self.kinematics.columns, wrenches)
    }

    /// The same in frame coordinates, X⁻ᵀ p.
    pub fn frame_momentum(&self, v: &DVector<f64>) -> DVector<f64> {
        self.frame_dual(&self.momentum(v))
    }

    /// X⁻ᵀ p: momenta or forces of joints in frame coordinates.
    pub(super) fn frame_dual(&self, p: &DVector<f64>) -> DVector<f64> {
        (self.system.tree).per_frame(&self.q, p, |j, q, p| j.frame_momentum(q, p))
    }

    /// p = Xᵀ p̂.
    pub fn user_momentum(&self, hat: &DVector<f64>) -> DVector<f64> {
        (self.system.tree).per_frame(&self.q, hat, |j, q, p| j.frame_momentum_transpose(q, p))
    }

    /// X w.
    pub fn frame_velocity(&self, w: &DVector<f64>) -> DVector<f64> {
        (self.system.tree).per_frame(&self.q, w, |j, q, w| j.frame_velocity(q, w))
    }

    /// X, nv × nv.
    pub(super) fn frame_matrix(&self) -> DMatrix<f64> {
        self.system.tree.frame_matrix(&self.q)
    }

    /// X⁻¹ w.
    pub(super) fn frame_velocity_inverse(&self, w: &DVector<f64>) -> DVector<f64> {
        (self.system.tree).per_frame(&self.q, w, |j, q, w| j.frame_velocity_inverse(q, w))
    }
}

impl Linearisation<'_> {
    /// Gradient of `wᵀ (M(q) v + p_rest(q))` over q, v and the parameters.
    ///
    /// # Errors
    /// A solve of the coupling that misses its tolerance.
    pub fn momentum_vjp(&self, v: &DVector<f64>, w: &DVector<f64>) -> Result<ForceCotangents> {
        self.bilinear_vjp(v, w, Some(self.current_twist()))
    }

    /// Gradient of `wᵀ M(q) v`, without the current.
    ///
    /// # Errors
    /// A solve of the coupling that misses its tolerance.
    pub fn mass_vjp(&self, v: &DVector<f64>, w: &DVector<f64>) -> Result<ForceCotangents> {
        self.bilinear_vjp(v, w, None)
    }

    /// Derivatives of the entries `entries` of `M(q) v + p_rest(q)`, the user's coordinates, those with respect to the parameters if they are asked for; the
    /// others have none.
    ///
    /// # Errors
    /// As [`Linearisation::momentum_vjp`].
    pub fn momentum_slopes(
        &self,
        v: &DVector<f64>,
        entries: &[usize],
        by_parameters: bool,
    ) -> Result<Slopes> {
        self.bilinear_slopes(v, entries, Some(self.current_twist()), by_parameters)
    }

    /// The same of `M(q) v`, without the current.
    ///
    /// # Errors
    /// As [`Linearisation::mass_vjp`].
    pub fn mass_slopes(
        &self,
        v: &DVector<f64>,
        entries: &[usize],
        by_parameters: bool,
    ) -> Result<Slopes> {
        self.bilinear_slopes(v, entries, None, by_parameters)
    }

    fn bilinear_slopes(
        &self,
        v: &DVector<f64>,
        entries: &[usize],
        current: Option<Vec6>,
        by_parameters: bool,
    ) -> Result<Slopes> {
        let n = v.len();
        let zero = ForceCotangents::zeros(self);
        let fields = self.still_fields(v);
        let at = |i| Pair {
            fields: &fields,
            v,
            w: unit(n, i),
            is_unit: true,
            by_parameters,
        };
        let rows: Vec<ForceCotangents> = match self.water()? {
            Some(water) => {
                let direction = self.direction(v, current);
                let momenta = self.momenta_in(water, &direction);
                // The first columns of the basis are the generalised velocities'.
                let pairs = water.linearised.gradient_columns(&direction)?;
                let row = |i: &usize| {
                    let (system, kinematics) = (self.system, &self.kinematics);
                    let momenta_virtual = water.fluid.column(system, kinematics, *i);
                    let carried = [&momenta, &momenta_virtual, &self.from_submerged(&pairs[*i])];
                    let at = at(*i);
                    let mut out = self.bilinear_row(&at, current, Some(carried.map(Vec::as_slice)));
                    self.add_bilinear_shape(water, &at, &direction, current, &mut out)?;
                    Ok(out)
                };
                entries.iter().map(row).collect::<Result<_>>()?
            }
            None => (entries.iter())
                .map(|i| self.bilinear_row(&at(*i), current, None))
                .collect(),
        };
        Ok(Slopes::from_rows(n, entries, &rows, &zero))
    }

    /// Coefficients on the basis of a velocity through water that moves with the current, if there is one asked for, or that rests.
    fn direction(&self, v: &DVector<f64>, current: Option<Vec6>) -> DVector<f64> {
        match current {
            Some(_) => self.through_water(v),
            None => self.virtual_direction(v),
        }
    }

    fn bilinear_vjp(
        &self,
        v: &DVector<f64>,
        w: &DVector<f64>,
        current: Option<Vec6>,
    ) -> Result<ForceCotangents> {
        let at = Pair {
            fields: &self.still_fields(v),
            v,
            w: w.clone(),
            is_unit: false,
            by_parameters: true,
        };
        let Some(water) = self.water()? else {
            return Ok(self.bilinear_row(&at, current, None));
        };
        let (direction, virtual_direction) =
            (self.direction(v, current), self.virtual_direction(w));
        let momenta = self.momenta_in(water, &direction);
        let momenta_virtual = self.momenta_in(water, &virtual_direction);
        let pair = water.linearised.gradient(&virtual_direction, &direction)?;
        let carried = [&momenta, &momenta_virtual, &self.from_submerged(&pair)];
        let mut out = self.bilinear_row(&at, current, Some(carried.map(Vec::as_slice)));
        self.add_bilinear_shape(water, &at, &direction, current, &mut out)?;
        Ok(out)
    }

    /// Adds the cotangents of the shapes for `ρ E(w, v)` to a row.
    fn add_bilinear_shape(
        &self,
        water: &Water,
        at: &Pair,
        direction: &DVector<f64>,
        current: Option<Vec6>,
        out: &mut ForceCotangents,
    ) -> Result<()> {
        if self.system.shapes.water.is_empty() || !at.by_parameters {
            return Ok(());
        }
        let current = current.unwrap_or_else(Vec6::zeros);
        let relative: Vec<Vec6> = at.fields.twist.iter().map(|t| t - current).collect();
        let virt = self.system.tree.twists(&self.kinematics, &at.w);
        let virtual_direction = self.virtual_direction(&at.w);
        let term = Bilinear {
            weight: 1.0,
            x: (Some(&virtual_direction), virt.as_slice()),
            y: (Some(direction), relative.as_slice()),
            along: None,
        };
        self.add_shape_vjp(water, &[term], &mut out.parameters)
    }

    /// Fields at the velocity `v`, without a virtual one.
    pub(super) fn still_fields(&self, v: &DVector<f64>) -> Fields {
        let zero = DVector::zeros(v.len());
        (self.system.tree).fields(&self.kinematics, &self.q, v, Virtual::Frame(&zero))
    }

    /// With the water's momenta of both velocities, and the slopes of their energy.
    pub(super) fn bilinear_row(
        &self,
        at: &Pair,
        current: Option<Vec6>,
        water: Option<[&[Vec6]; 3]>,
    ) -> ForceCotangents {
        let Pair { fields, v, w, .. } = at;
        let tree = &self.system.tree;
        let rho = self.parameters.density();
        let mut out = ForceCotangents::zeros(self);
        let fields = tree.with_virtual(&self.kinematics, &self.q, fields, Virtual::User(w));
        let mut bar = Cotangents::zeros(self.system.len());
        for b in 0..self.system.len() {
            let virt = &fields.virtual_twist[b];
            if at.skips(virt) {
                continue;
            }
            let drift = current.map_or(Vec6::zeros(), |_| *self.system.drift.of(b));
            let twist = &(fields.twist[b] - drift);
            let (h, h_virtual) = (self.rigid_momentum(b, twist), self.rigid_momentum(b, virt));
            bar.virtual_twist[b] += h;
            bar.twist[b] += h_virtual;
            bar.pose[b] -= cross_force(twist, &h_virtual) + cross_force(virt, &h);
            if at.by_parameters {
                rigid_parameters_vjp(self, b, virt, twist, &mut out.parameters);
            }
        }
        if let Some([momenta, momenta_virtual, pair]) = water {
            let current = current.unwrap_or_else(Vec6::zeros);
            for (b, _) in self.system.submerged() {
                let relative = fields.twist[b] - current;
                let virt = &fields.virtual_twist[b];
                // The water carries it to bodies behind other joints.
                if at.skips(virt) && [momenta_virtual[b], pair[b]] == [Vec6::zeros(); 2] {
                    continue;
                }
                *out.parameters.density_mut() += virt.dot(&momenta[b]);
                bar.virtual_twist[b] += rho * momenta[b];
                bar.twist[b] += rho * momenta_virtual[b];
                bar.pose[b] += rho
                    * (pair[b]
                        - cross_force(&relative, &momenta_virtual[b])
                        - cross_force(virt, &momenta[b]));
            }
        }
        let (q_bar, v_bar) = tree.reverse(&self.kinematics, v, Virtual::User(w), &fields, bar);
        out.q += q_bar;
        out.v += v_bar;
        let (v_bar, bar) = (&mut out.v, &mut out.parameters);
        (self.system.armature).add_vjp(self.parameters, v, w, v_bar, bar);
        out
    }
}
