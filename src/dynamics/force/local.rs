//! Forces on one body that follow from its twist through the water, from controls and perhaps from the velocity of a joint, as its own frame sees them.
//!
//! With ν = (u, ω) the twist through the water in the body's frame, about its origin, the wrench there is W(ν; controls, parameters). It turns with the
//! body: where the body is has no other effect, and the transpose in the pose is that of the frame's change alone.

use super::{Commanded, ForceModel, LoadBars, Loads, Moving, Outside, Together, Velocity};
use crate::Result;
use crate::adjoint::lie::{Mat6, Vec3, Vec6, cross_force, six, skew};
use crate::dynamics::Parameters;

/// A law of one body. Six-vectors are in the body's frame, about its origin.
pub(super) trait Law: Send + Sync {
    /// The body.
    fn body(&self) -> usize;

    /// The wrench at the twist `nu` through the water.
    fn wrench(&self, nu: &Vec6, at: &Moving) -> Vec6;

    /// Its derivative with respect to `nu`.
    fn slope(&self, nu: &Vec6, at: &Moving) -> Mat6;

    /// Adds the gradient of the wrench's power on the twist `zeta` with respect to controls and parameters.
    fn inputs_vjp(&self, nu: &Vec6, zeta: &Vec6, at: &Moving, bar: &mut LoadBars);

    /// Whether it does anything at these parameters, at some twist and control.
    fn acts(&self, _parameters: &Parameters) -> bool {
        true
    }

    /// Whether it changes no energy where nothing is controlled.
    fn is_conservative(&self, parameters: &Parameters) -> bool {
        !self.acts(parameters)
    }

    /// The controls' part of its power, W; zero where it has none.
    fn driven_power(&self, _nu: &Vec6, _at: &Moving) -> f64 {
        0.0
    }

    /// The velocity of a joint that it follows from besides, by its number, and the wrench's derivative with respect to it.
    fn by_rate(&self, _nu: &Vec6, _at: &Moving) -> Option<(usize, Vec6)> {
        None
    }

    /// The body that has that velocity.
    fn rotor(&self) -> Option<usize> {
        None
    }

    /// How a control drives it, if one does.
    fn commanded(&self, _parameters: &Parameters) -> Option<Commanded> {
        None
    }

    /// Whether it resists motion ([`ForceModel::resists`]).
    fn resists(&self) -> bool {
        false
    }

    /// Refuses parameters that no single one's range does.
    fn check(&self, _parameters: &Parameters) -> Result<()> {
        Ok(())
    }
}

/// All laws of a kind.
pub(super) struct Local<L> {
    name: &'static str,
    laws: Vec<L>,
}

impl<L: Law + 'static> Local<L> {
    /// None where there is none.
    pub fn assemble(name: &'static str, laws: Vec<L>) -> Option<Box<dyn ForceModel>> {
        (!laws.is_empty()).then(|| Box::new(Self { name, laws }) as Box<dyn ForceModel>)
    }
}

/// What the velocity of the point `at` along `direction` is of a twist about the body's origin; times a force that acts there along it, the force's wrench.
pub(super) fn component(direction: &Vec3, at: &Vec3) -> Vec6 {
    six(direction, &at.cross(direction))
}

/// What makes of a twist about the body's origin that about the point `p`, `[1, −[p]×; 0, 1]`; its transpose brings a wrench back.
pub(super) fn about(p: &Vec3) -> Mat6 {
    let mut out = Mat6::identity();
    out.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew(p));
    out
}

impl<L: Law> ForceModel for Local<L> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn add(&self, at: &Moving, out: &mut Loads) {
        for law in &self.laws {
            let b = law.body();
            let pose = &at.place.poses[b];
            let nu = pose.twist_to_body(&at.relative(b));
            out.wrenches[b] += pose.wrench_to_world(&law.wrench(&nu, at));
        }
    }

    fn jvp(&self, at: &Moving, change: &Velocity, out: &mut Loads) {
        self.jvps(at, std::slice::from_ref(change), std::slice::from_mut(out));
    }

    fn jvps(&self, at: &Moving, changes: &[Velocity], out: &mut [Loads]) {
        for law in &self.laws {
            let b = law.body();
            let pose = &at.place.poses[b];
            let nu = pose.twist_to_body(&at.relative(b));
            let slope = law.slope(&nu, at);
            let by_rate = law.by_rate(&nu, at);
            for (change, out) in changes.iter().zip(out.iter_mut()) {
                let mut wrench = slope * pose.twist_to_body(&change.twists[b]);
                if let Some((rate, by)) = &by_rate {
                    wrench += change.v[*rate] * by;
                }
                out.wrenches[b] += pose.wrench_to_world(&wrench);
            }
        }
    }

    fn vjp(&self, at: &Moving, z: &Velocity, bar: &mut LoadBars) {
        self.vjps(at, std::slice::from_ref(z), std::slice::from_mut(bar), true);
    }

    fn vjps(&self, at: &Moving, z: &[Velocity], bars: &mut [LoadBars], _: bool) {
        for law in &self.laws {
            let b = law.body();
            let pose = &at.place.poses[b];
            let relative = at.relative(b);
            let nu = pose.twist_to_body(&relative);
            let wrench = pose.wrench_to_world(&law.wrench(&nu, at));
            let slope = law.slope(&nu, at);
            let by_rate = law.by_rate(&nu, at);
            for (z, bar) in z.iter().zip(bars.iter_mut()) {
                let virt = &z.twists[b];
                if *virt == Vec6::zeros() {
                    continue;
                }
                let zeta = pose.twist_to_body(virt);
                law.inputs_vjp(&nu, &zeta, at, bar);
                if let Some((rate, by)) = &by_rate {
                    bar.v[*rate] += zeta.dot(by);
                }
                let nu_bar = pose.wrench_to_world(&slope.tr_mul(&zeta));
                at.relative_vjp(b, &nu_bar, bar);
                // The rotation of the frame acts on both twists.
                bar.pose[b] -= cross_force(&relative, &nu_bar) + cross_force(virt, &wrench);
            }
        }
    }

    fn resists(&self) -> bool {
        self.laws.iter().all(Law::resists)
    }

    fn ties(&self) -> Option<Vec<[usize; 2]>> {
        let tie = |law: &L| Some([law.rotor()?, law.body()]);
        Some(self.laws.iter().filter_map(tie).collect())
    }

    fn outside(&self, group: &Together, parameters: &Parameters) -> Outside {
        let acts = |law: &L| group.holds(law.body()) && law.acts(parameters);
        match self.laws.iter().any(acts) {
            true => Outside::All,
            false => Outside::Nothing,
        }
    }

    fn conservative(&self, parameters: &Parameters) -> bool {
        self.laws.iter().all(|law| law.is_conservative(parameters))
    }

    fn driven_power(&self, at: &Moving, moving: &Moving) -> f64 {
        let power = |law: &L| {
            let b = law.body();
            let nu = moving.place.poses[b].twist_to_body(&moving.relative(b));
            law.driven_power(&nu, at).abs()
        };
        self.laws.iter().map(power).sum()
    }

    fn commanded(&self, parameters: &Parameters) -> Vec<Commanded> {
        let each = self.laws.iter();
        each.filter_map(|law| law.commanded(parameters)).collect()
    }

    fn check(&self, parameters: &Parameters) -> Result<()> {
        self.laws.iter().try_for_each(|law| law.check(parameters))
    }
}
