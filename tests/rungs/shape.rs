//! Rungs of the fluid's energy with the shapes of bodies: couplings against ones that are made anew with moved vertices.

use super::tools::{all, along, wavy};
use hydrograd::adjoint::check::{Outcome, Rung};
use hydrograd::adjoint::lie::{Mat6, Pose, Vec3, Vec6, exp_matrix};
use hydrograd::boundary::PanelBoundary;
use hydrograd::coupling::full::{FullSolver, SolveSettings};
use hydrograd::coupling::reduced::compress::{CompressSettings, compress};
use hydrograd::coupling::reduced::{Cutoff, Reduced, ReducedBody, ShapeSlope};
use hydrograd::coupling::{
    Direction, Exclusions, ExtrapolatedPanels, Given, Isolated, Linearise, PanelCoupled,
    ShapeDirection, ShapeTerm,
};
use hydrograd::dynamics::Integrator;
use hydrograd::geometry::TriMesh;
use hydrograd::scene::{Body, Contact, Fluid, Joint, Scene, Shape, Wall, WallSurface};
use hydrograd::shape;
use hydrograd::{Controls, Fidelity, Settings, Simulator, objective};
use nalgebra::{DMatrix, DVector};
use std::path::Path;
use std::sync::Arc;

pub fn rungs() -> Vec<Rung> {
    macro_rules! rungs {
        ($($name:literal => $check:expr),* $(,)?) => {
            vec![$(Rung { name: $name, check: $check }),*]
        };
    }
    rungs![
        "coupling::isolated::IsolatedLinearised::shape_vjp" => |c| check(&isolated(), c),
        "coupling::reduced::linearised::ReducedLinearised::shape_vjp" => |c| all(reduced().iter().map(|s| check(s, c))),
        "dynamics::shape::Linearisation::add_shape_vjp" => |c| rollouts(&[swimming()], c),
        "dynamics::shapes::Shapes::follow_vjp" => |c| rollouts(&[swimming()], c),
        "dynamics::contact_shape::System::add_contact_shape_vjp" => |c| rollouts(&landing(), c),
        "coupling::response::ResponseLinearised::shape_vjp" => |c| all(alone().iter().map(|s| check(s, c))),
        "coupling::panel::extrapolated::ExtrapolatedLinearised::shape_vjp" => |c| check(&extrapolated(), c),
        "coupling::given::GivenLinearised::shape_vjp" => |c| check(&given(), c),
    ]
}

const WALL: Wall = Wall {
    surface: WallSurface::Rigid,
    point: [0.0, 0.0, -0.9],
    normal: [0.1, 0.0, 1.0],
};

/// A coupling of two bodies whose shape parameters have moved by these, and where it is asked.
struct System {
    couple: Box<dyn Fn([f64; 2]) -> Box<dyn Linearise>>,
    poses: [Pose; 2],
}

/// Meshes of two bodies, and how their vertices move with the parameter of each.
#[derive(Clone)]
struct Bodies {
    meshes: [TriMesh; 2],
    velocities: [Vec<Vec3>; 2],
}

impl Bodies {
    fn new(shapes: &[Shape; 2], faces: usize) -> Self {
        let build = |s: &Shape| shape::build(s, Path::new("."), Some(faces)).unwrap();
        let meshes = [build(&shapes[0]), build(&shapes[1])];
        // One field for every mesh of a body.
        let field = |b: usize| {
            let [a, c] = [0.3, 1.3].map(|phase| wavy(9, phase + b as f64, 0.2));
            let of = |x: &Vec3| {
                Vec3::from_fn(|i, _| {
                    let at = |n: usize| a[3 * i + n];
                    at(0) * x.x + at(1) * (2.0 * x.y).sin() + at(2) * x.z * x.x + 0.2 * c[i]
                })
            };
            meshes[b].vertices().iter().map(of).collect()
        };
        Self {
            velocities: [field(0), field(1)],
            meshes,
        }
    }

    fn at(&self, h: [f64; 2]) -> Vec<Arc<PanelBoundary>> {
        let body = |b: usize| {
            let mesh = &self.meshes[b];
            let pairs = mesh.vertices().iter().zip(&self.velocities[b]);
            let vertices = pairs.map(|(x, v)| x + h[b] * v).collect();
            let mesh = TriMesh::new("moved", vertices, mesh.faces().to_vec()).unwrap();
            Arc::new(PanelBoundary::new("b", &mesh).unwrap())
        };
        vec![body(0), body(1)]
    }

    /// Both parameters, and how what is known of added masses changes, if it is.
    fn directions(&self, known: [Option<Mat6>; 2]) -> Vec<ShapeDirection> {
        let of = |body: usize| ShapeDirection {
            body,
            vertices: self.velocities[body].clone(),
            added_mass: known[body],
        };
        vec![of(0), of(1)]
    }
}

fn coupled(
    bodies: Vec<Arc<PanelBoundary>>,
    solver: FullSolver,
    walls: &[Wall],
    excluded: &Exclusions,
) -> PanelCoupled {
    let settings = SolveSettings {
        solver,
        tolerance: 1e-13,
        ..SolveSettings::default()
    };
    PanelCoupled::new(bodies, walls, excluded.clone(), settings).unwrap()
}

fn pose(translation: [f64; 3], turn: [f64; 3]) -> Pose {
    Pose::new(exp_matrix(&Vec3::from(turn)), Vec3::from(translation))
}

/// Two spheres; a box near a box, flat on flat; an ellipsoid near a wall with what is known better of it; and bodies that feel each other's images in a free surface alone.
fn alone() -> Vec<System> {
    let of =
        |shapes: [Shape; 2], poses, walls: Vec<Wall>, solver, excluded: Exclusions, known: bool| {
            let bodies = Bodies::new(&shapes, 80);
            let mass = Mat6::from_diagonal(&Vec6::new(1.0, 1.1, 0.9, 0.1, 0.2, 0.3));
            let couple = move |h: [f64; 2]| -> Box<dyn Linearise> {
                let given = [known.then(|| (1.0 + 0.4 * h[0]) * mass), None];
                let rates = [known.then(|| 0.4 * mass), None];
                let made = coupled(bodies.at(h), solver, &walls, &excluded);
                let made = made.with_added_mass(&given);
                Box::new(made.with_shapes(bodies.directions(rates)).unwrap())
            };
            System {
                couple: Box::new(couple),
                poses,
            }
        };
    let apart = [
        pose([0.0; 3], [0.1, 0.2, 0.3]),
        pose([1.3, 0.1, 0.0], [0.3, -0.2, 0.1]),
    ];
    let near = [pose([0.0; 3], [0.0; 3]), pose([0.6, 0.0, 0.0], [0.0; 3])];
    let (ball, egg) = (Shape::sphere(0.4), Shape::ellipsoid([0.6, 0.3, 0.4]));
    let block = Shape::cuboid([0.5, 0.4, 0.6]);
    let free = Wall {
        surface: WallSurface::Free,
        ..WALL
    };
    let (none, gmres) = (Exclusions::none, FullSolver::Gmres);
    vec![
        of(
            [ball.clone(), ball.clone()],
            apart,
            Vec::new(),
            gmres,
            none(),
            false,
        ),
        of(
            [block.clone(), block],
            near,
            Vec::new(),
            FullSolver::Qr,
            none(),
            false,
        ),
        of(
            [egg.clone(), ball.clone()],
            apart,
            vec![WALL],
            gmres,
            none(),
            true,
        ),
        of(
            [egg, ball],
            apart,
            vec![free],
            gmres,
            Exclusions::new([(0, 1)]),
            false,
        ),
    ]
}

/// Two meshes of each body, the ratio of whose edges moves too.
fn extrapolated() -> System {
    let shapes = [Shape::sphere(0.4), Shape::ellipsoid([0.6, 0.3, 0.4])];
    let [fine, coarse] = [80, 20].map(|faces| Bodies::new(&shapes, faces));
    let couple = move |h: [f64; 2]| -> Box<dyn Linearise> {
        let of = |bodies: &Bodies| {
            coupled(
                bodies.at(h),
                FullSolver::Gmres,
                &[WALL],
                &Exclusions::none(),
            )
        };
        let ratio = 2.0 + 0.3 * h[0] - 0.2 * h[1];
        let made = ExtrapolatedPanels::new(of(&fine), of(&coarse), ratio).unwrap();
        let [fine, coarse] = [&fine, &coarse].map(|b| b.directions([None; 2]));
        Box::new(made.with_shapes(fine, coarse, vec![0.3, -0.2]).unwrap())
    };
    System {
        couple: Box::new(couple),
        poses: [
            pose([0.0; 3], [0.1, 0.2, 0.3]),
            pose([1.3, 0.1, 0.0], [0.3, -0.2, 0.1]),
        ],
    }
}

/// The first body's added mass stays as it is given.
fn given() -> System {
    let bodies = Bodies::new(&[Shape::sphere(0.4), Shape::sphere(0.3)], 80);
    let couple = move |h: [f64; 2]| -> Box<dyn Linearise> {
        let made = bodies.at(h);
        let change = [Mat6::identity() - made[0].added_mass, Mat6::zeros()];
        let rate = made[0].added_mass_slopes().along(&bodies.velocities[0]);
        let made = coupled(made, FullSolver::Gmres, &[], &Exclusions::none());
        let made = made.with_shapes(bodies.directions([None; 2])).unwrap();
        let given = Given::new(Box::new(made), change.to_vec()).unwrap();
        let own = vec![(0, rate), (1, Mat6::zeros())];
        Box::new(given.with_shapes(own).unwrap())
    };
    System {
        couple: Box::new(couple),
        poses: [
            pose([0.0; 3], [0.1, 0.2, 0.3]),
            pose([1.0, 0.1, 0.0], [0.0; 3]),
        ],
    }
}

/// Bodies that feel nobody, each with an added mass that changes along with a parameter.
fn isolated() -> System {
    let couple = move |h: [f64; 2]| -> Box<dyn Linearise> {
        let slope = |b: usize| {
            let half = Mat6::from_vec(wavy(36, 0.3 + b as f64, 0.2).as_slice().to_vec());
            half + half.transpose()
        };
        let own = |b: usize| 2.0 * Mat6::identity() + h[b] * slope(b);
        let made = Isolated::new(vec![own(0), own(1)]);
        Box::new(
            made.with_shapes(vec![(0, slope(0)), (1, slope(1))])
                .unwrap(),
        )
    };
    System {
        couple: Box::new(couple),
        poses: [
            pose([0.0; 3], [0.1, 0.2, 0.3]),
            pose([1.0, 0.1, 0.0], [0.0; 3]),
        ],
    }
}

/// A compressed body, and how it changes by itself: points, modes, strengths and added mass along fixed numbers.
struct Compressed {
    body: ReducedBody,
    modes: DMatrix<f64>,
    slope: ShapeSlope,
}

impl Compressed {
    fn new(shape: &Shape, phase: f64) -> Self {
        let mesh = shape::build(shape, Path::new("."), Some(160)).unwrap();
        let response = PanelBoundary::new("b", &mesh).unwrap();
        let settings = CompressSettings {
            rank: Some(24),
            tolerance: 1e-2,
            resolved_gap: Some(0.3),
        };
        let body = compress("b", &mesh, &response, &settings, &[]).unwrap();
        let parts = body.parts();
        let like = |m: &DMatrix<f64>, phase: f64| {
            let (rows, columns) = m.shape();
            let numbers = wavy(rows * columns, phase, 0.3 * m.amax());
            DMatrix::from_column_slice(rows, columns, numbers.as_slice())
        };
        let modes = like(&parts.modes, phase);
        let half = Mat6::from_vec(wavy(36, phase + 0.3, 0.02).as_slice().to_vec());
        let moved = wavy(3 * parts.points.len(), phase + 0.2, 0.1);
        let slope = ShapeSlope {
            points: (moved.as_slice().chunks(3))
                .map(Vec3::from_row_slice)
                .collect(),
            strengths: like(&parts.strengths, phase + 0.1),
            solution: &modes * parts.modes.transpose() + &parts.modes * modes.transpose(),
            added_mass: half + half.transpose(),
        };
        Self { body, modes, slope }
    }

    fn at(&self, h: f64) -> Arc<ReducedBody> {
        let mut parts = self.body.parts().clone();
        for (p, d) in parts.points.iter_mut().zip(&self.slope.points) {
            *p += h * d;
        }
        parts.modes += h * &self.modes;
        parts.strengths += h * &self.slope.strengths;
        parts.added_mass += h * self.slope.added_mass;
        Arc::new(ReducedBody::new(parts).unwrap())
    }
}

/// Compressed bodies without walls, with one, and where the pair is fading.
fn reduced() -> Vec<System> {
    let fading = Cutoff {
        near: 0.5,
        far: 2.0,
    };
    let of = |walls: Vec<Wall>, cutoff: Option<Cutoff>| {
        let bodies = [
            Compressed::new(&Shape::cuboid([0.5, 0.4, 0.6]), 0.5),
            Compressed::new(&Shape::ellipsoid([0.6, 0.3, 0.4]), 0.9),
        ];
        let couple = move |h: [f64; 2]| -> Box<dyn Linearise> {
            let made = vec![bodies[0].at(h[0]), bodies[1].at(h[1])];
            let made = Reduced::new(made, &walls, |_, _| cutoff).unwrap();
            let slopes = [0, 1].map(|b| (b, bodies[b].slope.clone()));
            Box::new(made.with_shapes(slopes.to_vec()).unwrap())
        };
        System {
            couple: Box::new(couple),
            poses: [
                pose([0.0; 3], [0.3, -0.2, 0.5]),
                pose([0.2, 1.0, 0.2], [-0.4, 0.1, 0.2]),
            ],
        }
    };
    vec![
        of(Vec::new(), None),
        of(vec![WALL], None),
        of(vec![WALL], Some(fading)),
    ]
}

/// A box and an ellipsoid on a hinge, in a current.
fn swimming() -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.fluid.current = [0.1, 0.05, -0.1];
    scene.time_step = 0.02;
    let of = |shape: Shape| Body::new(shape).density(1100.0);
    let mut first = of(Shape::ellipsoid([0.4, 0.7, 0.2])).named("first");
    first.shape_at.position = [0.02, 0.01, -0.03];
    scene.add(first);
    let mut second = of(Shape::sphere(0.4)).named("second");
    second.parent = Some("first".into());
    second.placement.position = [1.6, 0.3, 0.2];
    second.shape_at.position = [0.1, 0.05, 0.0];
    scene.add(second.joint(Joint::Revolute {
        axis: [0.3, 1.0, 0.2],
    }));
    scene.initial.v = vec![0.3, -0.2, 0.25, 0.5, 0.4, -0.6, 0.7];
    scene
}

/// Dry bodies that slide over a wall and press on it: of every kind that contact knows.
fn landing() -> Vec<Scene> {
    let shapes = [
        Shape::ellipsoid([0.4, 0.3, 0.25]),
        Shape::cuboid([0.4, 0.7, 0.5]),
        Shape::cylinder(0.3, 0.5),
        Shape::capsule(0.25, 0.4),
    ];
    let scene = |shape: &Shape| {
        let mut scene = Scene::new(Fluid::none());
        scene.time_step = 0.005;
        scene.add_wall([0.0, 0.0, -0.3], [0.1, 0.0, 1.0]);
        scene.contact = Some(Contact {
            stiffness: Some(3e4),
            friction: 0.4,
            gap: Some(0.02),
            width: Some(0.02),
            ..Contact::default()
        });
        scene.add(Body::new(shape.clone()).density(800.0).named("first"));
        scene.initial.v = vec![0.3, 0.4, -1.0, 0.5, 0.4, -0.6];
        scene
    };
    shapes.iter().map(scene).collect()
}

/// Gradients of rollouts with the shapes of scenes against scenes that are built anew.
fn rollouts(scenes: &[Scene], corruption: f64) -> Outcome {
    all(scenes.iter().map(|scene| {
        let cost = |scene: &Scene, shapes: bool| {
            let settings = Settings::default()
                .fidelity(Fidelity::Isolated)
                .integrator(Integrator::MomentumEuler)
                .shape_parameters(if shapes { vec!["*".into()] } else { Vec::new() });
            let simulator = Simulator::new(scene, settings).unwrap();
            let rollout = simulator.rollout(&Controls::zeros(&simulator, 6)).unwrap();
            let velocities = rollout.samples()[0].v.len();
            let goal = (0..velocities).fold(
                objective::mean_position(hydrograd::scene::BodyId(0), [0.3, 0.1, -0.2]),
                |sum, i| sum + objective::final_velocity(i, 0.1 * i as f64, 0.3 + 0.1 * i as f64),
            );
            (
                rollout.value(&goal).unwrap(),
                rollout.gradient(&goal).unwrap(),
            )
        };
        let gradient = cost(scene, true).1.parameters;
        all(scene.shape_parameters().into_iter().map(|(name, value)| {
            let slope = gradient.get(&name).unwrap();
            let at = |h: f64| {
                let changed = scene
                    .with_shape_parameter(&name, value * (1.0 + h))
                    .unwrap();
                cost(&changed, false).0
            };
            along(at, corruption * value * slope)
        }))
    }))
}

/// E and its slope along a displacement, of a direction on the basis with one outside it and with itself.
fn check(system: &System, corruption: f64) -> Outcome {
    let basis = DMatrix::from_vec(12, 3, wavy(36, 0.4, 1.0).as_slice().to_vec());
    let (on, twist) = (wavy(3, 1.1, 1.0), wavy(12, 2.2, 1.0));
    let z = wavy(12, 0.7, 0.3);
    let z: Vec<Vec6> = z.as_slice().chunks(6).map(Vec6::from_row_slice).collect();
    let (x, y) = (Direction::Twist(&twist), Direction::Basis(&on));
    let twists = |x: Direction| match x {
        Direction::Basis(c) => &basis * c,
        Direction::Twist(x) => x.clone(),
    };
    let made = (system.couple)([0.0; 2]);
    assert_eq!(made.shape_parameters(), 2);
    let record = made.linearise(&system.poses, &basis).unwrap();
    let asked = [(x, y, false), (y, y, false), (x, y, true), (x, x, true)];
    all(asked.into_iter().flat_map(|(x, y, displaced)| {
        let term = ShapeTerm {
            weight: 0.7,
            x,
            y,
            along: displaced.then_some(&z[..]),
        };
        // Terms add up.
        let slopes: DVector<f64> = 0.5 * record.shape_vjp(&[term, term]).unwrap();
        let value = |h: [f64; 2]| {
            let made = (system.couple)(h);
            let record = made.linearise(&system.poses, &basis).unwrap();
            let found = record.vjp(x, y).unwrap();
            0.7 * match displaced {
                true => found.wrench.iter().zip(&z).map(|(w, z)| w.dot(z)).sum(),
                false => found.momentum_x.dot(&twists(y)),
            }
        };
        let (first, second) = (corruption * slopes[0], corruption * slopes[1]);
        [
            along(|h| value([h, 0.0]), first),
            along(|h| value([0.0, h]), second),
        ]
    }))
}
