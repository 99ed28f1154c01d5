//! Many bodies that fall through water onto a wide floor, as a heap.

use super::GRAVITY;
use hydrograd::Rollout;
use hydrograd::adjoint::lie::Vec3;
use hydrograd::adjoint::sample::Samples;
use hydrograd::scene::{Body, Contact, Drag, DragPart, Fluid, Scene, Shape};
use hydrograd::simulate::Sample;

/// Room of a body before it falls, m.
const CELL: f64 = 0.09;
/// Bodies beside one another.
const SIDE: usize = 5;
/// How far from the middle a body may come to rest, m.
pub const REACH: f64 = 1.0;

/// So many bodies of six kinds and a few sizes, heavier than the water, in a grid that is a little out of order, a
/// column above a floor at z = 0.
pub fn heap(bodies: usize, time_step: f64) -> Scene {
    let mut random = Samples::new(17);
    let mut scene = Scene::new(Fluid::fresh_water());
    scene.gravity = [0.0, 0.0, -GRAVITY];
    scene.time_step = time_step;
    scene.contact = Some(Contact {
        rolling_friction: 5e-4,
        torsional_friction: 5e-4,
        ..Contact::default()
    });
    scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]);
    for b in 0..bodies {
        let (layer, cell) = (b / (SIDE * SIDE), b % (SIDE * SIDE));
        let across = |k: usize| CELL * (k as f64 - 0.5 * (SIDE - 1) as f64);
        let at = Vec3::new(
            across(cell % SIDE),
            across(cell / SIDE),
            0.06 + CELL * layer as f64,
        );
        let at = at + 0.1 * CELL * Vec3::from(random.vector(1.0));
        let mut body = Body::new(shape(b, [0.8, 1.0, 1.2][b / 6 % 3]))
            .density([1400.0, 2000.0, 2700.0][b % 3])
            .at(at.into())
            .rotated(random.vector(3.0));
        body.drag = Some(Drag {
            quadratic_part: DragPart::Normal,
            quadratic: 1.0,
            ..Drag::default()
        });
        scene.add(body);
    }
    scene
}

/// No larger than a ball of 4 cm.
fn shape(kind: usize, size: f64) -> Shape {
    let [a, b, c] = [0.03, 0.022, 0.016].map(|x| x * size);
    let faces = 80;
    match kind % 6 {
        0 => Shape::sphere(b).faces(faces),
        1 => Shape::ellipsoid([a, b, c]).faces(faces),
        2 => Shape::cuboid([2.0 * b, 2.0 * c, 1.2 * a]).faces(faces),
        3 => Shape::cylinder(c, 1.5 * a).faces(faces),
        4 => Shape::capsule(c, a).faces(faces),
        _ => Shape::prism(
            vec![[-b, -c], [-0.7 * b, c], [0.8 * b, c], [b, -c]],
            1.2 * a,
        )
        .faces(faces),
    }
}

/// What became of a heap.
pub struct Heap {
    /// Bodies whose middles are above the floor, and no farther from that of all than [`REACH`].
    pub inside: usize,
    /// Whether all numbers are.
    pub finite: bool,
    /// The smallest signed distance of two bodies, or of a body and a wall, at any of the states looked at, m.
    pub deepest: f64,
    /// The same of the last state.
    pub deepest_at_end: f64,
    /// The thinnest gap at which any are taken to touch, m.
    pub gap: f64,
    /// At the end, J.
    pub kinetic: f64,
    /// The most at any time, J.
    pub most_kinetic: f64,
    /// Height of the highest middle at the end, m.
    pub height: f64,
}

impl Heap {
    /// Of a rollout, with every `stride`-th state looked at for overlap.
    pub fn of(rollout: &Rollout, stride: usize) -> hydrograd::Result<Self> {
        let system = rollout.simulator().system();
        let model = system.contact.as_ref().expect("a scene with contact");
        let samples = rollout.samples();
        let least = |sample: &Sample| -> hydrograd::Result<f64> {
            let mut least = f64::INFINITY;
            for pair in model.shapes.near(&sample.poses, |_| 0.0) {
                let points = model.shapes.points_within(&pair, &sample.poses, 0.0)?;
                let full = points.iter().filter(|p| p.weight >= 0.5);
                least = full.map(|p| p.gap).fold(least, f64::min);
            }
            Ok(least)
        };
        let mut deepest = f64::INFINITY;
        for sample in samples.iter().step_by(stride) {
            deepest = least(sample)?.min(deepest);
        }
        let last = samples.last().expect("a start");
        let inside = |x: &Vec3| x.z > 0.0 && x.xy().norm() < REACH;
        let heights = last.poses.iter().map(|g| g.translation.z);
        let finite = |s: &Sample| s.q.iter().chain(&s.v).all(|x| x.is_finite());
        let kinetic = samples.iter().map(|s| s.kinetic_energy);
        Ok(Self {
            inside: last.poses.iter().filter(|g| inside(&g.translation)).count(),
            finite: samples.iter().all(finite),
            deepest,
            deepest_at_end: least(last)?,
            gap: model.laws.least,
            kinetic: last.kinetic_energy,
            most_kinetic: kinetic.fold(0.0, f64::max),
            height: heights.fold(0.0, f64::max),
        })
    }
}
