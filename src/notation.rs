//! Symbols, frames, signs, units and equation numbers. Documentation only.
//!
//! # Units
//! SI throughout: m, kg, s, N, N m, rad, J. Densities kg/m³, linear drag kg/(m² s). Fluid quantities
//! inside [`crate::coupling`] and [`crate::boundary`] are at unit density of the fluid (m³, m⁴, m⁵);
//! [`crate::dynamics`] multiplies by ρ.
//!
//! # Frames
//! - The *world* is right-handed; nothing prefers an axis. A pose maps body to world,
//!   `x_world = R x_body + t` ([`crate::adjoint::lie::Pose`]).
//! - A body's pose is `parent pose ∘ placement ∘ joint motion`; its origin is where its joint acts, not
//!   its centre of mass.
//! - Six-vectors are linear part first, angular part second.
//! - *Body-frame* twists (u, ω): velocity of the body's origin and angular velocity, body axes. Wrenches and
//!   momenta: moment about the body's origin. Used by `boundary` and `coupling`.
//! - *Spatial* twists: velocity of the material point that passes the world origin, and angular
//!   velocity, world axes; spatial wrenches have their moment about the world origin. Used by
//!   `multibody` and `dynamics`.
//! - *Generalised* velocities v of a free joint: velocity of the body's origin and angular velocity, axes
//!   of the joint's frame. v isn't the rate of q for free and spherical joints, whose q holds a unit
//!   quaternion (w, x, y, z).
//! - *Frame* velocities v̂ = X(q) v: the twist about the joint frame's origin. Frame momenta
//!   p̂ = X⁻ᵀ p are the integrators' variables ([`crate::multibody::Joint`]).
//!
//! # Signs
//! - Normals point out of the body, into the water. Faces are wound counter-clockwise seen from outside.
//! - A source of strength α at s makes φ = α/|x − s| and the velocity −∇φ (the paper's sign, Eq. 7 and
//!   16): the water runs from high φ to low, and a positive source sends water out.
//! - The fluid's energy is ½ ρ ∮ φ (u·n) dA ≥ 0.
//! - A rigid wall's image has the same sign as its source.
//! - Drag and added-mass forces act against motion; wrenches are on the body.
//! - Displacements of a pose act on the left in the world, `δR = [δθ]× R`. The derivative of a scalar with
//!   respect to a pose is a spatial wrench.
//! - `vjp` is Jᵀȳ without a hidden sign.
//!
//! # Tangents and cotangents
//! `dq` is a tangent, `q_bar` a cotangent, a dot is time. Tangents and cotangents of q have the length of v: a
//! displacement of q is `q ⊕ ξ` ([`crate::multibody::Tree::integrate`]).
//!
//! # Symbols
//! Lengths: B bodies, n_v velocities, N sources, F faces, k basis columns.
//!
//! | symbol | name | shape, unit |
//! |---|---|---|
//! | q | `q`: joint coordinates | n_q; m, rad, unit quaternions |
//! | v | `v`: generalised velocity | n_v; m/s, rad/s |
//! | p, p̂ | `momentum`, `frame_momentum` (`y` of a state) | n_v; kg m/s, kg m²/s |
//! | u | `control`: joint forces, wrenches on bodies, commands of thrusters | controls; N, N m, any |
//! | J, S, Ŝ | [`Tree::jacobian`](crate::multibody::Tree::jacobian), `columns`, `frame_columns` | 6B × n_v, spatial |
//! | V, Z, D, C | `twist`, `virtual_twist`, `turning`, `bias` of [`Fields`](crate::multibody::Fields) | 6 a body, spatial |
//! | M(q) | `mass_matrix` | n_v × n_v |
//! | M_r | [`spatial_inertia`](crate::adjoint::rigid::spatial_inertia), `rigid` | 6 × 6 a body, body frame |
//! | M_f, M̄_f | `momenta`: M̄_f times the basis; [`Simulator::added_mass`](crate::Simulator::added_mass) | 6B × k; 6B × 6B |
//! | E(g; x̄, ȳ) | twice the fluid's energy as a bilinear form ([`crate::coupling`]) | m⁵/s² at unit density |
//! | ρ, U, g | `density`, `current`, `gravity` | kg/m³, m/s, m/s² |
//! | α, a | source strengths: of one problem, per direction | N × k; m²/s |
//! | ε | depth of a source below the surface ([`boundary::Depth`](crate::boundary::Depth)) | m |
//! | K | entries of [`flux_fill`](crate::adjoint::kernel::flux_fill) or [`normal_fill`](crate::adjoint::kernel::normal_fill), rows scaled by `row_weights` | F × N |
//! | F̄ | `twist_rows`: the scaled rows' right-hand side per body twist | F × 6 |
//! | P, B̄ | `1/r` at the readout points, `readout_flux` | F × N, F × 6 |
//! | r, λ, μ | residual `F x̄ − K a`, adjoint strengths, `K λ` | F × k, N × k, F × k |
//! | X(q) | [`JointMotion::frame_velocity`](crate::multibody::JointMotion::frame_velocity) | per joint |
//! | ⊕ | [`JointModel::integrate`](crate::multibody::JointModel::integrate) | |
//!
//! The paper uses K_f for both a matrix (`1/r`, our P) and the fluid's energy, and writes ∇ above K for
//! the matrix of normal velocities (our K).
//!
//! # Equations of the paper
//!
//! | equation | what | where |
//! |---|---|---|
//! | 1, 2 | Lagrangian and its equations of motion | [`crate::dynamics`] |
//! | 3, 4 | semi-implicit Euler in velocity | [`Integrator::VelocityEuler`](crate::dynamics::Integrator::VelocityEuler), [`Linearisation::inertial_force`](crate::dynamics::Linearisation::inertial_force) |
//! | 5 | rate of a rotation vector to angular velocity | [`exp_jacobian`](crate::adjoint::lie::exp_jacobian) |
//! | 6 | kinetic energy of a rigid body | [`spatial_inertia`](crate::adjoint::rigid::spatial_inertia) |
//! | 7–9 | potential and added mass of one body | [`BodyBoundary`](crate::boundary::BodyBoundary) |
//! | 10–12 | bodies that don't feel each other | [`Isolated`](crate::coupling::Isolated) |
//! | 13–15 | coupled potential and M_f(q) | [`Full`](crate::coupling::full::Full) |
//! | 16 | fundamental solution | [`crate::adjoint::kernel`] |
//! | 17, 18 | sources under faces, velocity at centres | [`Method::MfsFace`](crate::boundary::Method::MfsFace) |
//! | 19 | energy by potential and flux at centres | [`Readout`](crate::boundary::Readout) |
//! | 20 | normal equations | [`cgls`](crate::solver::cgls) |
//! | 21 | derivative of the solution | [`Linearised::vjp`](crate::coupling::Linearised::vjp), [`Linearised::hvp`](crate::coupling::Linearised::hvp): transposed, with the residual terms of least squares |
//! | 22 | drag along the surface | [`resistance`](crate::adjoint::drag::resistance) |
//!
//! The default departs from these: sources under vertices and flux rows instead of 17–18, an energy of
//! second order in the residual instead of 19, a step in momentum instead of 3–4. `preset = "paper"`
//! selects the paper's own choices; docs/accuracy.md says what each costs.
