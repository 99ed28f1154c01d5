//! Scenes that the tests of contact share.

pub use crate::support::falling::{above_floor, above_slope, contact, touching, under_gravity};
use hydrograd::scene::{Body, Joint, Scene, Shape};

/// A vertical rail.
pub const RAIL: Joint = Joint::Prismatic {
    axis: [0.0, 0.0, 1.0],
};

/// A body at the height `above` over a slope, turned with it.
pub fn on_slope(slope: f64, above: f64, shape: Shape) -> Scene {
    let mut scene = above_slope(slope, 0.0);
    let angle = slope.atan();
    scene.add(
        Body::new(shape)
            .density(1000.0)
            .at([above * angle.sin(), 0.0, above * angle.cos()])
            .rotated([0.0, angle, 0.0]),
    );
    scene
}

/// Printed, and held to its limit.
#[track_caller]
pub fn within(what: &str, found: f64, exact: f64, limit: f64) {
    let error = (found - exact).abs() / exact.abs();
    println!(
        "{what}: {found:.5}, exact {exact:.5}, error {:.2} %",
        100.0 * error
    );
    assert!(error <= limit, "{what}: {found} is not {exact}");
}

/// Where a property that is false at the lower end and true at the upper one sets in, by bisection to `width`.
#[track_caller]
pub fn threshold(sets_in: impl Fn(f64) -> bool, [mut low, mut high]: [f64; 2], width: f64) -> f64 {
    assert!(!sets_in(low) && sets_in(high));
    while high - low > width {
        let middle = 0.5 * (low + high);
        match sets_in(middle) {
            true => high = middle,
            false => low = middle,
        }
    }
    0.5 * (low + high)
}
