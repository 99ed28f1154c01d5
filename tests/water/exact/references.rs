//! The references against each other: tables, series and multipoles were found in different ways.

use crate::support::reference::{
    TwoSpheres, ellipsoids, equal_spheres, image_series, lamb, multipoles, spheres_by_wall,
};

#[test]
fn lambs_coefficients_by_carlson_are_those_of_the_table() {
    for (semi_axes, exact) in ellipsoids() {
        for (found, exact) in lamb(semi_axes).iter().zip(exact) {
            // In rotation, differences of the coefficients cancel.
            assert!((found - exact).abs() <= 1e-12 * exact, "{semi_axes:?}");
        }
    }
}

#[test]
fn two_spheres_by_multipoles_and_by_images_are_those_of_the_table() {
    for pair in equal_spheres() {
        let exact = pair.coefficients();
        for (found, exact) in multipoles(pair.distance).iter().zip(exact) {
            assert!((found - exact).abs() < 1e-10, "gap {}", pair.gap());
        }
        let [along, along12, ..] = exact;
        for sign in [1.0, -1.0] {
            let images = image_series(pair.distance, sign);
            assert!((images / (along - sign * along12) - 1.0).abs() < 1e-10);
        }
    }
}

/// Gaps that the table doesn't have; far apart they are dipoles.
#[test]
fn two_spheres_at_any_gap() {
    for gap in [0.01, 0.02, 0.3, 7.0] {
        let [along, along12, ..] = multipoles(2.0 + gap);
        for sign in [1.0, -1.0] {
            let images = image_series(2.0 + gap, sign);
            assert!(
                (images / (along - sign * along12) - 1.0).abs() < 1e-9,
                "{gap}"
            );
        }
    }
    let own = 2.0 / 3.0 * std::f64::consts::PI;
    let [along, along12, across, across12] = TwoSpheres::equal(102.0).coefficients();
    let dipole = -3.0 * own / 102f64.powi(3);
    assert!((along / own - 1.0).abs() < 1e-10 && (across / own - 1.0).abs() < 1e-10);
    assert!(
        (along12 / dipole - 1.0).abs() < 1e-5 && (across12 / (-0.5 * dipole) - 1.0).abs() < 1e-5
    );
}

/// A wall is the mirror image, at twice the height.
#[test]
fn a_sphere_by_a_wall_is_one_of_two() {
    for known in spheres_by_wall() {
        let [along, along12, across, across12] = multipoles(2.0 * known.height);
        assert!((known.across - (along - along12)).abs() < 1e-10);
        assert!((known.along - (across + across12)).abs() < 1e-10);
    }
}
