//! The equations of motion at one configuration, as a multibody user reads them: inertia, bias, accelerations and forces, Jacobians, centres.
//!
//! ```text
//! M(q) v̇ + h(q, v, u) = τ
//! ```
//!
//! M holds the water; h is what is left: Coriolis and centrifugal terms of bodies and water, gravity, buoyancy, drag, springs, less the controls u. Contact and stops of
//! joints, which a step solves ([`Integrator::solves_contact`](crate::dynamics::Integrator::solves_contact)), aren't in it, nor are dampers solved with them. Servos
//! pull as they do at an instant, k (u − q) − c q̇, whatever the time step by which they look ahead in steps.

use super::Simulator;
use crate::adjoint::lie::{Pose, Vec3, Vec6, angular, linear, point_velocity, point_wrench, six};
use crate::dynamics::{Drive, Linearisation};
use crate::multibody::Virtual;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};

/// The equations of motion at one configuration: made by [`Simulator::equations`].
///
/// ```
/// use hydrograd::scene::{Body, Fluid, Scene, Shape};
/// use hydrograd::{Fidelity, Settings, Simulator};
///
/// let mut scene = Scene::new(Fluid::fresh_water());
/// scene.add(Body::new(Shape::sphere(0.1)).density(2.0 * 998.0));
/// let simulator = Simulator::new(&scene, Settings::default().fidelity(Fidelity::Isolated))?;
/// let (q, v) = simulator.start();
/// let equations = simulator.equations(q)?;
/// let (rigid, added) = (equations.rigid_mass_matrix()?, equations.added_mass_matrix()?);
/// // The added mass of a sphere is that of half the water it displaces.
/// assert!((added[(0, 0)] / rigid[(0, 0)] - 0.25).abs() < 1e-2);
/// assert_eq!(equations.bias_force(v, &simulator.no_control())?.norm(), 0.0);
/// # Ok::<(), hydrograd::Error>(())
/// ```
pub struct Equations<'s> {
    pub(super) at: Linearisation<'s>,
}

impl Simulator {
    /// The equations of motion at the coordinates `q`, of driven joints too, at the time 0: [`Simulator::equations_at`].
    ///
    /// # Errors
    /// As there.
    pub fn equations(&self, q: &DVector<f64>) -> Result<Equations<'_>> {
        self.equations_at(q, 0.0)
    }

    /// The equations of motion at the coordinates `q`, of driven joints too; currents are as they are at `time`, s.
    ///
    /// # Errors
    /// A wrong length, values that aren't finite (the time's too), quaternions not of length 1; bodies in one another or in a wall, and gaps that aren't resolved; whatever the coupling
    /// reports, or one that has values only.
    pub fn equations_at(&self, q: &DVector<f64>, time: f64) -> Result<Equations<'_>> {
        self.check_configuration("q", q)?;
        if !time.is_finite() {
            return Err(Error::input("time", time, "must be finite, in s"));
        }
        self.check_apart(q, self.parameters().density())?;
        let at = self.system().linearise(self.parameters(), q, time)?;
        Ok(Equations { at })
    }

    /// Controls that do nothing.
    pub fn no_control(&self) -> DVector<f64> {
        DVector::zeros(self.system().controls)
    }

    /// q ⊕ ξ: the configuration that `q` becomes by the tangent `xi` (an entry a generalised velocity; of rotations a rotation vector, rad, in the joint's frame).
    ///
    /// # Errors
    /// As [`Simulator::equations`] of the numbers.
    pub fn integrate(&self, q: &DVector<f64>, xi: &DVector<f64>) -> Result<DVector<f64>> {
        self.check_configuration("q", q)?;
        let place = "tangent of the configuration";
        check_numbers(place, xi, self.system().tree.velocities())?;
        Ok(self.system().tree.integrate(q, xi))
    }

    /// The tangent by which [`Simulator::integrate`] gets from one configuration to another; of rotations the shorter way.
    ///
    /// # Errors
    /// As there.
    pub fn difference(&self, from: &DVector<f64>, to: &DVector<f64>) -> Result<DVector<f64>> {
        self.check_configuration("the first configuration", from)?;
        self.check_configuration("the second configuration", to)?;
        Ok(self.system().tree.difference(from, to))
    }
}

pub(super) fn check_numbers(place: &str, x: &DVector<f64>, n: usize) -> Result<()> {
    match x.len() == n && x.iter().all(|x| x.is_finite()) {
        true => Ok(()),
        false => Err(Error::input(
            place,
            format!("{:?}", x.as_slice()),
            format!("must be {n} finite numbers"),
        )),
    }
}

impl Equations<'_> {
    /// M(q), rigid and fluid, generalised coordinates: kg, kg m, kg m².
    ///
    /// # Errors
    /// A solve of the coupling that misses its tolerance.
    pub fn mass_matrix(&self) -> Result<&DMatrix<f64>> {
        let found = self.at.mass_matrix();
        self.at.check()?;
        Ok(found)
    }

    /// The bodies' own part of M(q).
    ///
    /// # Errors
    /// None that [`Simulator::equations`] hasn't found.
    pub fn rigid_mass_matrix(&self) -> Result<DMatrix<f64>> {
        let mut dry = self.at.parameters.clone();
        *dry.density_mut() = 0.0;
        let dry = self.at.system.evaluate(&dry, &self.at.q, self.at.time)?;
        Ok(dry.mass_matrix().clone())
    }

    /// The water's part of M(q).
    ///
    /// # Errors
    /// As [`Equations::mass_matrix`].
    pub fn added_mass_matrix(&self) -> Result<DMatrix<f64>> {
        Ok(self.mass_matrix()? - self.rigid_mass_matrix()?)
    }

    fn check(&self, v: &DVector<f64>, control: &DVector<f64>) -> Result<()> {
        check_numbers("velocity v", v, self.at.system.tree.velocities())?;
        check_numbers("controls u", control, self.at.system.controls)
    }

    /// h(q, v, u), generalised forces: N, N m.
    ///
    /// # Errors
    /// Wrong lengths, and a solve of the coupling.
    pub fn bias_force(&self, v: &DVector<f64>, control: &DVector<f64>) -> Result<DVector<f64>> {
        self.check(v, control)?;
        Ok(self.at.ahead(v, control) - self.at.inertial_force(v, control)?)
    }

    /// Forward dynamics, v̇ at further generalised forces `force` (τ). Joints that a motion drives, or that are locked, keep the acceleration that they have in
    /// `driven`, whose other entries aren't read.
    ///
    /// # Errors
    /// Wrong lengths, a mass matrix that isn't positive definite, and a solve of the coupling.
    pub fn acceleration(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
        force: &DVector<f64>,
        driven: &DVector<f64>,
    ) -> Result<DVector<f64>> {
        self.acceleration_holding(v, control, force, driven, &[])
    }

    /// The same where the joints of bodies in `hold` are held; an empty one holds none.
    pub(super) fn acceleration_holding(
        &self,
        v: &DVector<f64>,
        control: &DVector<f64>,
        force: &DVector<f64>,
        driven: &DVector<f64>,
        hold: &[bool],
    ) -> Result<DVector<f64>> {
        let system = self.at.system;
        let n = system.tree.velocities();
        check_numbers("generalised force", force, n)?;
        check_numbers("acceleration of driven joints", driven, n)?;
        let (mut free, mut given) = (Vec::new(), driven.clone());
        let held = system.tree.held(hold);
        let joints = system.drives.iter().zip(system.tree.links());
        for ((drive, link), held) in joints.zip(held) {
            if *drive == Drive::Free && !held {
                free.extend(link.v.clone());
                link.v.clone().for_each(|i| given[i] = 0.0);
            }
        }
        let mut right = force - self.bias_force(v, control)?;
        if given.iter().any(|x| *x != 0.0) {
            right -= self.at.mass_times(&given);
        }
        let found = self.at.factored(&free)?.solve(&right);
        self.at.check()?;
        self.at.check_energy(&found, &right)?;
        Ok(given + found)
    }

    /// Inverse dynamics: the generalised forces τ at which the acceleration is `acceleration` (m/s², rad/s²); of driven joints what drives them.
    ///
    /// # Errors
    /// Wrong lengths, and a solve of the coupling.
    pub fn force(
        &self,
        v: &DVector<f64>,
        acceleration: &DVector<f64>,
        control: &DVector<f64>,
    ) -> Result<DVector<f64>> {
        self.check(v, control)?;
        check_numbers("acceleration", acceleration, v.len())?;
        Ok(self.at.mass_times(acceleration) + self.bias_force(v, control)?)
    }

    /// Poses of the bodies in the world.
    pub fn poses(&self) -> &[Pose] {
        &self.at.kinematics.poses
    }

    fn body(&self, body: usize) -> Result<&Pose> {
        let poses = self.poses();
        poses.get(body).ok_or_else(|| {
            Error::input(
                "body",
                body,
                format!("must be under {}, counted from 0", poses.len()),
            )
        })
    }

    /// Velocity of a point (m, its frame) of body number `body` in the world and the body's angular velocity, world axes (m/s, rad/s), per generalised velocity: 6 × nv.
    ///
    /// # Errors
    /// A body that isn't there.
    pub fn point_jacobian(&self, body: usize, point: &Vec3) -> Result<DMatrix<f64>> {
        let x = self.body(body)?.apply(point);
        let tree = &self.at.system.tree;
        Ok(tree.point_jacobian(&self.at.kinematics, body, &x))
    }

    /// Velocity of that point and the body's angular velocity at `v`, world axes: m/s, rad/s.
    ///
    /// # Errors
    /// As [`Equations::point_jacobian`], and a wrong length.
    pub fn point_velocity(&self, v: &DVector<f64>, body: usize, point: &Vec3) -> Result<Vec6> {
        let jacobian = self.point_jacobian(body, point)?;
        check_numbers("velocity v", v, jacobian.ncols())?;
        Ok((jacobian * v).fixed_rows::<6>(0).into_owned())
    }

    /// Acceleration of that point and angular acceleration of the body at `v` and v̇, world axes: m/s², rad/s².
    ///
    /// # Errors
    /// As [`Equations::point_velocity`].
    pub fn point_acceleration(
        &self,
        v: &DVector<f64>,
        acceleration: &DVector<f64>,
        body: usize,
        point: &Vec3,
    ) -> Result<Vec6> {
        let velocity = self.point_velocity(v, body, point)?;
        check_numbers("acceleration", acceleration, v.len())?;
        let x = self.body(body)?.apply(point);
        let (tree, kinematics) = (&self.at.system.tree, &self.at.kinematics);
        let zero = DVector::zeros(v.len());
        let fields = tree.fields(kinematics, &self.at.q, v, Virtual::User(&zero));
        let spatial = tree.twists(kinematics, acceleration)[body] + fields.bias[body];
        let turning = angular(&velocity).cross(&linear(&velocity));
        let of_point = point_velocity(&spatial, &x) + turning;
        Ok(six(&of_point, &angular(&spatial)))
    }

    /// Total mass, kg, and centre of mass of the bodies in the world, m; none where there is no mass.
    pub fn center_of_mass(&self) -> Option<(f64, Vec3)> {
        let parameters = self.at.parameters;
        let of = |b: usize| (b, parameters.mass(b), parameters.center_of_mass(b));
        let (mass, moment) = self.moment((0..self.at.system.len()).map(of));
        (mass > 0.0).then(|| (mass, moment / mass))
    }

    /// Volume of what bodies displace, below a `waterline`, and of what floats them, m³, and its centre, at which their buoyancy acts together, in the world, m; none where nothing is
    /// in the water.
    pub fn center_of_buoyancy(&self) -> Option<(f64, Vec3)> {
        let parameters = self.at.parameters;
        let of = |b: usize| (b, parameters.volume(b), parameters.center_of_buoyancy(b));
        let (whole, own) = self.moment((0..self.at.system.len()).map(of));
        let (beside, moment) = self.at.displaced();
        let volume = whole + beside;
        // What is all out of the water leaves rounding.
        (volume > 1e-12 * whole).then(|| (volume, (own + moment) / volume))
    }

    /// The sum of parts of bodies, given with the points of their frames at which they are, and its moment about the world's origin.
    fn moment(&self, parts: impl Iterator<Item = (usize, f64, Vec3)>) -> (f64, Vec3) {
        let poses = self.poses();
        parts.fold((0.0, Vec3::zeros()), |(size, moment), (b, own, at)| {
            (size + own, moment + own * poses[b].apply(&at))
        })
    }

    /// Kinetic energy of bodies and water at `v`, J; the water's in the frame that moves with the current.
    ///
    /// # Errors
    /// A wrong length.
    pub fn kinetic_energy(&self, v: &DVector<f64>) -> Result<f64> {
        check_numbers("velocity v", v, self.at.system.tree.velocities())?;
        Ok(self.at.kinetic_energy(v))
    }

    /// Potential energy, J.
    pub fn potential_energy(&self) -> f64 {
        self.at.potential_energy()
    }

    /// Momentum and angular momentum about the world's origin of bodies and water at `v`: kg m/s, kg m²/s.
    ///
    /// # Errors
    /// A wrong length.
    pub fn momentum(&self, v: &DVector<f64>) -> Result<Vec6> {
        check_numbers("velocity v", v, self.at.system.tree.velocities())?;
        Ok(self.at.total_momentum(v, &self.at.momenta(v)))
    }

    /// The generalised forces of a force (N) and a torque (N m), world axes, at a point (m, its frame) of a body: Jᵀ of them.
    ///
    /// # Errors
    /// As [`Equations::point_jacobian`].
    pub fn wrench_force(&self, body: usize, point: &Vec3, wrench: &Vec6) -> Result<DVector<f64>> {
        let x = self.body(body)?.apply(point);
        let mut wrenches = vec![Vec6::zeros(); self.poses().len()];
        wrenches[body] = point_wrench(&x, &linear(wrench)) + six(&Vec3::zeros(), &angular(wrench));
        let tree = &self.at.system.tree;
        Ok(tree.project(&self.at.kinematics.columns, wrenches))
    }
}
