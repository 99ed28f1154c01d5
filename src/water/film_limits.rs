//! Limits of thin films.

use crate::adjoint::lie::{Pose, Vec3, exp_matrix};
use crate::coupling::film::{Between, Film, FilmSurface, NoFilm, PlacedFilm, Shares, Side};
use crate::geometry::{HalfSpace, Image, Opposite, Wall};
use crate::scene::Shape;
use crate::shape;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

/// Over the wall z = 0, which a film is compared at with one that is held `floor` apart at contact.
fn over_wall(shape: &Shape, faces: usize, floor: f64) -> Arc<Film> {
    let mesh = shape::build(shape, Path::new("."), Some(faces)).unwrap();
    let wall = Wall::rigid([0.0; 3], [0.0, 0.0, 1.0]);
    let other = Side::Wall(Image::of_walls(&[wall]).unwrap()[1]);
    let plane = HalfSpace::new(&Vec3::zeros(), &Vec3::z()).unwrap();
    let between = (
        Arc::new(FilmSurface::new(&mesh, true)),
        Arc::new(Opposite::of_wall(plane)),
    );
    let shares = Shares {
        floor: 0.25,
        floor_at_edges: 0.25,
        floor_between_faces: 0.25,
        rim: 0.43,
        rim_to_wall: 0.65,
        farther_between_faces: 1.0,
        in_corners: true,
    };
    let reach = shares.reach(&other, between.0.size, 4.0 * floor);
    Arc::new(Film::new(0, other, between, reach, &shares, Between::Edges))
}

/// What the film adds to the energy of a unit twist (component `k` in the body's frame, about its origin) at a pose, and its slope as the body rises.
fn added(film: &Arc<Film>, pose: &Pose, k: usize) -> (f64, f64) {
    let mut twists = DMatrix::zeros(6, 1);
    twists[(k, 0)] = 1.0;
    let placed = PlacedFilm::new(film, &[*pose], &twists).unwrap();
    let placed = placed.expect("a film");
    let mut out = DMatrix::zeros(6, 1);
    placed.add_impulses(&twists, &mut out);
    let x: DVector<f64> = twists.column(0).into_owned();
    (out[(k, 0)], placed.wrench(&x, &x)[2])
}

fn raised(height: f64) -> Pose {
    Pose::new(exp_matrix(&Vec3::zeros()), Vec3::new(0.0, 0.0, height))
}

/// Faces that lie parallel at a gap h: ρ π R⁴/8h for a disc, 0.035144 ρ a⁴/h for a square, with less than a rim's part beside it where h is small.
#[test]
fn parallel_faces_hold_what_the_film_equation_says() {
    let gap = 5e-4;
    let floor = 0.1;
    let disc = over_wall(&Shape::cylinder(1.0, 0.25), 2000, floor);
    let (m, slope) = added(&disc, &raised(0.125 + gap), 2);
    let exact = PI / 8.0 / gap;
    assert!((m / exact - 1.0).abs() < 0.015, "{m} for {exact}");
    assert!((-slope * gap / exact - 1.0).abs() < 0.025, "{slope}");
    let block = over_wall(&Shape::cuboid([1.0, 1.0, 0.5]), 2000, 0.05);
    let (m, slope) = added(&block, &raised(0.25 + gap), 2);
    let exact = 0.0351443 / gap;
    assert!((m / exact - 1.0).abs() < 0.04, "{m} for {exact}");
    assert!((-slope * gap / exact - 1.0).abs() < 0.05, "{slope}");
}

/// A long strip of width w and length L: ρ w³ L/12h, less at the ends; and tilted about its axis so that the gap goes from h₁ to h₂, the minimum of ∫ (x − c)²/h dx over c: the flow divides
/// where both ends are in the open.
#[test]
fn strips_are_those_of_one_dimension() {
    let (width, long, thick) = (1.0, 12.0, 0.6);
    let strip = over_wall(&Shape::cuboid([width, long, thick]), 4000, 0.05);
    let steps = 4000;
    let of = |near: f64, tilt: f64| -> f64 {
        let h = |x: f64| near + (x + 0.5 * width) * tilt;
        let sum = |power: i32| -> f64 {
            let dx = width / f64::from(steps);
            let at = |k: i32| (f64::from(k) + 0.5) * dx - 0.5 * width;
            (0..steps).map(|k| at(k).powi(power) / h(at(k)) * dx).sum()
        };
        long * (sum(2) - sum(1).powi(2) / sum(0))
    };
    for (near, tilt) in [(1e-3, 0.0), (1e-3, 0.004), (1e-3, 0.02)] {
        let turn = exp_matrix(&Vec3::new(0.0, -tilt, 0.0));
        let height = near + 0.5 * (width * tilt.sin() + thick * tilt.cos());
        let pose = Pose::new(turn, Vec3::new(0.0, 0.0, height));
        let (m, _) = added(&strip, &pose, 2);
        // Less what the film would hold if it were held apart.
        let apart = of(near + 0.05, tilt);
        // Saint-Venant's short ends: 192/π⁵ of the width over the length less.
        let ends = 1.0 - 0.6274 * width / long;
        let exact = ends * (of(near, tilt) - apart);
        assert!(
            (m / exact - 1.0).abs() < 0.03,
            "tilt {tilt}: {m} for {exact}"
        );
    }
}

/// Curved surfaces: the slope of the mass goes as −2π/(tr κ √det κ) ln(1/h) with the relative curvature κ; between two gaps nothing but the logarithm is
/// left.
#[test]
fn the_slope_under_a_sphere_is_a_logarithm() {
    let film = over_wall(&Shape::sphere(1.0), 20_000, 0.1);
    let slope = |gap: f64| added(&film, &raised(1.0 + gap), 2).1;
    let (near, far) = (0.004, 0.016);
    let exact = -PI * f64::ln(far / near);
    let found = slope(near) - slope(far);
    assert!((found / exact - 1.0).abs() < 0.12, "{found} for {exact}");
}

/// Far above the reach there is none; a body that reaches behind the wall is refused with how far.
#[test]
fn there_is_no_film_far_away_nor_in_touch() {
    let film = over_wall(&Shape::sphere(1.0), 320, 0.05);
    let placed = |height: f64| PlacedFilm::new(&film, &[raised(height)], &DMatrix::zeros(6, 0));
    assert!(placed(1.3).unwrap().is_none());
    let Err(NoFilm::Touching(behind)) = placed(0.99) else {
        panic!("a disc behind a wall has no film");
    };
    assert!((-0.011..0.0).contains(&behind), "{behind}");
}
