//! Scenes that the tests of contact share.

use crate::support::GRAVITY;
use hydrograd::scene::{Contact, Fluid, Joint, Scene};

/// A vertical rail.
pub const RAIL: Joint = Joint::Prismatic {
    axis: [0.0, 0.0, 1.0],
};

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
