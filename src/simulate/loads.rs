//! What acts on every body and joint at a state: what load cells, torque sensors and inertial measurement units would tell.

use super::equations::check_numbers;
use super::{Equations, Rollout};
use crate::adjoint::lie::{Pose, Vec3, Vec6, angular, linear, six};
use crate::dynamics::Drive;
use crate::{Error, Result};
use nalgebra::DVector;

/// Wrenches on all bodies at one state, kind by kind, and across their joints: forces (N) and moments about each body's origin (N m), world axes.
///
/// Kinds are the scene's forces by what they are ("gravity", "buoyancy", "linear drag", "spring", "thrust", "fin", …; all springs together, whatever the scene names them), "water" (what the inertia of the water does: added mass), and
/// of a step "contact" and the dampers solved with it. With the fidelity `isolated` the water's inertia does nothing to bodies that can't move. With the wrench across its own joint and the opposite ones across the joints of what it carries, they are the rate of a body's own momentum.
#[derive(Clone, Debug)]
pub struct Loads {
    acceleration: DVector<f64>,
    kinds: Vec<(String, Vec<Vec6>)>,
    joints: Vec<Vec6>,
    joint_forces: DVector<f64>,
}

/// What an inertial measurement unit reads, its own axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Imu {
    /// Acceleration less gravity, m/s²: of one at rest, as much upward as gravity pulls down.
    pub specific_force: Vec3,
    /// Rates about its axes, rad/s.
    pub rates: Vec3,
}

impl Loads {
    /// v̇, generalised.
    pub fn acceleration(&self) -> &DVector<f64> {
        &self.acceleration
    }

    /// What acts on bodies, in the order in which it is added up.
    pub fn kinds(&self) -> impl Iterator<Item = &str> {
        self.kinds.iter().map(|(name, _)| name.as_str())
    }

    /// What one kind does to each body; none that there isn't.
    pub fn wrenches(&self, kind: &str) -> Option<&[Vec6]> {
        let found = self.kinds.iter().find(|(name, _)| name == kind);
        found.map(|(_, wrenches)| wrenches.as_slice())
    }

    /// The wrench on each body from what carries it, across its joint, about the body's origin; of its drive, springs and stops as well, and zero where a free joint has none.
    pub fn joints(&self) -> &[Vec6] {
        &self.joints
    }

    /// Those along the axes of the joints, generalised, N or N m: what a sensor in the drive reads. The drive's own rotor (armature) is on the other side of it.
    pub fn joint_forces(&self) -> &DVector<f64> {
        &self.joint_forces
    }
}

/// What drives a state, the acceleration that follows, and what a step has solved for.
struct Driven {
    control: DVector<f64>,
    acceleration: DVector<f64>,
    further: Vec<(&'static str, Vec<Vec6>)>,
}

/// From the world's origin to those of the bodies.
fn about(poses: &[Pose], wrenches: Vec<Vec6>) -> Vec<Vec6> {
    let moved = |(w, pose): (Vec6, &Pose)| {
        let force = linear(&w);
        six(&force, &(angular(&w) - pose.translation.cross(&force)))
    };
    wrenches.into_iter().zip(poses).map(moved).collect()
}

/// Adds to what there is by this name, or another kind.
fn add(kinds: &mut Vec<(String, Vec<Vec6>)>, name: &str, wrenches: Vec<Vec6>) {
    match kinds.iter_mut().find(|(known, _)| known == name) {
        Some((_, sum)) => sum.iter_mut().zip(wrenches).for_each(|(s, w)| *s += w),
        None => kinds.push((name.into(), wrenches)),
    }
}

impl Equations<'_> {
    /// What acts on bodies and joints at the velocity `v`, the controls and the acceleration `acceleration`; joints take what is missing, those that are free too.
    ///
    /// # Errors
    /// Wrong lengths, and a solve of the coupling.
    pub fn loads(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
        acceleration: &DVector<f64>,
    ) -> Result<Loads> {
        self.loads_with(v, control, acceleration, Vec::new())
    }

    /// The same with further spatial wrenches, by name.
    fn loads_with(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
        acceleration: &DVector<f64>,
        further: Vec<(&str, Vec<Vec6>)>,
    ) -> Result<Loads> {
        let (e, system) = (&self.at, self.at.system);
        let n = system.tree.velocities();
        check_numbers("velocity v", v, n)?;
        check_numbers("acceleration", acceleration, n)?;
        check_numbers("controls u", control, system.controls)?;
        let mut kinds = Vec::new();
        for (name, wrenches) in e.force_wrenches(v, control) {
            add(&mut kinds, name, wrenches);
        }
        add(&mut kinds, "water", e.water_wrenches(v, acceleration)?);
        for (name, wrenches) in further {
            add(&mut kinds, name, wrenches);
        }
        // What a body's momentum gains beyond all this comes across joints: from what carries it, less what it hands on.
        let mut missing = e.rigid_rates(v, acceleration);
        for (_, wrenches) in &kinds {
            let each = missing.iter_mut().zip(wrenches);
            each.for_each(|(left, w)| *left -= w);
        }
        let (tree, poses) = (&system.tree, self.poses());
        let kinds = kinds.into_iter();
        Ok(Loads {
            acceleration: acceleration.clone(),
            kinds: kinds.map(|(name, w)| (name, about(poses, w))).collect(),
            joint_forces: tree.project(&e.kinematics.columns, missing.clone()),
            joints: about(poses, tree.composite(missing)),
        })
    }
}

impl Rollout {
    /// What acts on bodies and joints at state `n` as step `n` starts: forces there, and contact, stops and stiff dampers as the step solved them (their mean in a step of several
    /// pieces, and to first order in the time step beside forces at the state), with the acceleration that all of it gives. At the last state there is no step: controls are zero, nothing touches.
    ///
    /// # Errors
    /// A state that there isn't, and whatever the equations of motion report.
    pub fn loads(&self, n: usize) -> Result<Loads> {
        self.loads_by(&self.equations_at_state(n)?, n)
    }

    /// The acceleration alone that [`Rollout::loads`] tells.
    pub(super) fn acceleration(&self, n: usize) -> Result<DVector<f64>> {
        Ok(self.driven(&self.equations_at_state(n)?, n)?.acceleration)
    }

    fn loads_by(&self, equations: &Equations, n: usize) -> Result<Loads> {
        let at = self.driven(equations, n)?;
        let v = &self.samples()[n].v;
        equations.loads_with(v, &at.control, &at.acceleration, at.further)
    }

    fn driven(&self, equations: &Equations, n: usize) -> Result<Driven> {
        let (simulator, sample) = (self.simulator(), &self.samples()[n]);
        let system = simulator.system();
        let nv = system.tree.velocities();
        let control = match sample.control.len() == system.controls {
            true => sample.control.clone(),
            false => simulator.no_control(),
        };
        let mut further = Vec::new();
        let mut force = DVector::zeros(nv);
        if let Some(record) = self.tape.records().get(n) {
            let solved = simulator.stepper().solved(record)?;
            force += solved.stops;
            further.extend(solved.dampers);
            if system.contact.is_some() {
                further.push(("contact", solved.contact));
            }
        }
        for (_, wrenches) in &further {
            let columns = &equations.at.kinematics.columns;
            force += system.tree.project(columns, wrenches.clone());
        }
        let mut driven = DVector::zeros(nv);
        for (drive, link) in system.drives.iter().zip(system.tree.links()) {
            if let Drive::Motion(motions) = drive {
                for (k, i) in link.v.clone().enumerate() {
                    driven[i] = motions[k].acceleration(sample.time);
                }
            }
        }
        let v = &sample.v;
        let acceleration =
            equations.acceleration_holding(v, &control, &force, &driven, &sample.hold)?;
        Ok(Driven {
            control,
            acceleration,
            further,
        })
    }

    /// What an inertial measurement unit at the site of this name reads at state `n`, with the acceleration of [`Rollout::loads`].
    ///
    /// # Errors
    /// A site that there isn't, and as [`Rollout::loads`].
    pub fn imu(&self, site: &str, n: usize) -> Result<Imu> {
        let system = self.simulator().system();
        let Some(site) = system.sites.iter().find(|s| s.name == site) else {
            let names: Vec<&str> = system.sites.iter().map(|s| s.name.as_str()).collect();
            let expected = format!("no site has that name; the sites are {names:?}");
            return Err(Error::input("imu: site", format!("{site:?}"), expected));
        };
        let equations = self.equations_at_state(n)?;
        let acceleration = self.driven(&equations, n)?.acceleration;
        let (v, at) = (&self.samples()[n].v, &site.pose.translation);
        let moves = equations.point_velocity(v, site.body, at)?;
        let gains = equations.point_acceleration(v, &acceleration, site.body, at)?;
        let axes = equations.poses()[site.body].rotation * site.pose.rotation;
        let gravity = Vec3::from(self.simulator().scene().gravity);
        Ok(Imu {
            specific_force: axes.tr_mul(&(linear(&gains) - gravity)),
            rates: axes.tr_mul(&angular(&moves)),
        })
    }

    fn equations_at_state(&self, n: usize) -> Result<Equations<'_>> {
        let sample = self.samples().get(n).ok_or_else(|| {
            let expected = format!("must be at most {}", self.steps());
            Error::input("loads: state", n, expected)
        })?;
        let at = (self.simulator().stepper()).linearise(&sample.q, sample.time);
        Ok(Equations {
            at: at.map_err(|e| e.at_time(sample.time))?,
        })
    }
}
