//! Bodies that fall onto a floor.

use super::GRAVITY;
use hydrograd::adjoint::lie::{Vec3, exp_matrix};
use hydrograd::adjoint::sample::Samples;
use hydrograd::scene::{Body, Contact, Fluid, Scene, Shape};

/// Under gravity, in fluid of this density, kg/m³; without contact.
pub fn under_gravity(density: f64) -> Scene {
    let mut scene = Scene::new(Fluid {
        density,
        current: [0.0; 3],
    });
    scene.gravity = [0.0, 0.0, -GRAVITY];
    scene
}

/// The same with contact, without a wall.
pub fn touching(density: f64) -> Scene {
    let mut scene = under_gravity(density);
    scene.contact = Some(Contact::default());
    scene
}

/// Above a floor at z = 0.
pub fn above_floor(density: f64) -> Scene {
    above_slope(0.0, density)
}

/// Above a floor through the origin that falls by `slope` along x.
pub fn above_slope(slope: f64, density: f64) -> Scene {
    let mut scene = touching(density);
    let angle = slope.atan();
    scene.add_wall([0.0; 3], [angle.sin(), 0.0, angle.cos()]);
    scene
}

pub fn contact(scene: &mut Scene) -> &mut Contact {
    scene.contact.get_or_insert_default()
}

/// Two of six kinds of convex shapes above a floor, turning; with `aimed`, the upper one is thrown at the lower one, and all pairs of
/// kinds come up.
pub fn drops(count: usize, dt: f64, aimed: bool) -> Vec<Scene> {
    let mut random = Samples::new(1);
    let mut next = |low, high| random.between(low, high);
    let mut out = Vec::new();
    for drop in 0..count {
        let mut scene = above_floor(0.0);
        scene.time_step = dt;
        for k in 0..2 {
            let mut size = || next(0.05, 0.15);
            let apart = if aimed { 1 + drop / 6 } else { 3 };
            let shape = match (drop + k * apart) % 6 {
                0 => Shape::sphere(size()),
                1 => Shape::ellipsoid([size(), size(), size()]),
                2 => Shape::cuboid([2.0 * size(), 2.0 * size(), 2.0 * size()]),
                3 => Shape::capsule(size(), 2.0 * size()),
                4 => Shape::cylinder(size(), 2.0 * size()),
                _ => Shape::prism(
                    vec![[-size(), 0.0], [size(), 0.0], [0.3 * size(), size()]],
                    2.0 * size(),
                ),
            };
            let turn = [next(-1.5, 1.5), next(-1.5, 1.5), next(-1.5, 1.5)];
            let place = [next(-0.03, 0.03), next(-0.03, 0.03), 0.3 + 0.45 * k as f64];
            scene.add(
                Body::new(shape.faces(80))
                    .density(1000.0)
                    .at(place)
                    .rotated(turn),
            );
        }
        scene.initial.v = (0..12)
            .map(|i| {
                if i % 6 < 3 {
                    next(-1.0, 1.0)
                } else {
                    next(-5.0, 5.0)
                }
            })
            .collect();
        if aimed {
            // Velocities are along the axes of the placement.
            for (k, down) in [(0, 0.0), (1, 2.0)] {
                let turned = exp_matrix(&Vec3::from(scene.bodies[k].placement.rotation));
                let drift = 0.3 * Vec3::from_row_slice(&scene.initial.v[6 * k..6 * k + 3]);
                let thrown = drift - down * turned.transpose() * Vec3::z();
                scene.initial.v[6 * k..6 * k + 3].copy_from_slice(thrown.as_slice());
            }
        }
        out.push(scene);
    }
    out
}
