//! Cylinders: known points, the least gap against the exact distance, slopes where they stand flat and where they
//! come over edges, and forces without jumps.

use super::slopes::slope_error;
use super::*;
use hydrograd::contact::RIM_POINTS;
use hydrograd::geometry::Gaps;
use hydrograd::shape::solid;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

/// Least gap of all points that count.
pub(super) fn least(points: &[ContactPoint]) -> f64 {
    let counted = points.iter().filter(|p| p.weight > 0.0);
    counted.map(|p| p.gap).fold(f64::INFINITY, f64::min)
}

fn floor() -> HalfSpace {
    HalfSpace::new(&Vec3::zeros(), &Vec3::z()).unwrap()
}

/// The distance by formula.
pub(super) fn distance(a: &Shape, a_at: &Pose, b: &Shape, b_at: &Pose) -> f64 {
    let mesh = |s: &Shape| build(s, Path::new("."), Some(80)).unwrap();
    let exact = |s: &Shape| solid(s, Pose::identity()).unwrap();
    let (first, second) = (mesh(a), mesh(b));
    let gaps = Gaps::new(&[Some(&first), Some(&second)], &[], &[]).unwrap();
    let gaps = gaps.by_formula(vec![exact(a), exact(b)]).unwrap();
    gaps.smallest(&[*a_at, *b_at]).unwrap().distance
}

#[test]
fn over_a_wall_the_least_gap_is_the_closed_form_at_every_tilt() {
    let body = plain(&Shape::cylinder(0.15, 0.3));
    for tilt in [
        0.0, 1e-12, 1e-6, 1e-3, 0.02, 0.05, 0.09, 0.11, 0.7, 1.5, FRAC_PI_2, 2.0, 3.1,
    ] {
        for spin in [0.0, 0.1, 0.39] {
            let turn = exp_matrix(&Vec3::new(0.6 * tilt, 0.8 * tilt, 0.0))
                * exp_matrix(&Vec3::new(0.0, 0.0, spin));
            let pose = Pose::new(turn, Vec3::new(0.3, -0.2, 0.4));
            let points = against_wall(&body, &floor(), &pose, 1.0).unwrap();
            let exact = 0.4 - 0.15 * f64::sin(tilt).abs() - 0.15 * f64::cos(tilt).abs();
            assert!(
                (least(&points) - exact).abs() < 4e-15,
                "{tilt} {:e}",
                least(&points) - exact
            );
            // Never less stiff than one point there.
            let near = points.iter().filter(|p| p.gap < exact + 0.01 * 0.15);
            let weight: f64 = near.map(|p| p.weight).sum();
            assert!(
                (1.0 - 1e-12..=RIM_POINTS as f64 + 1.0).contains(&weight),
                "{tilt} {weight}"
            );
        }
    }
    // Standing: the points in place alone. On its side: one for each end.
    let standing = against_wall(&body, &floor(), &at(0.0, 0.0, 0.151), 0.01).unwrap();
    assert_eq!(standing.len(), RIM_POINTS);
    assert!(
        standing
            .iter()
            .all(|p| p.weight == 1.0 && (p.gap - 1e-3).abs() < 1e-15)
    );
    let lying = turned([FRAC_PI_2, 0.0, 0.0], [0.0, 0.0, 0.151]);
    let lying = against_wall(&body, &floor(), &lying, 0.01).unwrap();
    assert_eq!(lying.len(), 2);
    for p in &lying {
        assert!(p.weight == 1.0 && (p.gap - 1e-3).abs() < 1e-15);
        assert!((p.position.y.abs() - 0.15).abs() < 1e-15 && p.position.x.abs() < 1e-15);
    }
}

#[test]
fn balls_meet_ends_rims_and_sides() {
    let (body, ball) = (
        plain(&Shape::cylinder(0.15, 0.3)),
        plain(&Shape::sphere(0.1)),
    );
    let (beside, above) = (Vec3::x(), Vec3::z());
    let slant = Vec3::new(0.6, 0.0, 0.8);
    let rim = Vec3::new(0.15, 0.0, 0.15);
    let places = [
        (0.05 * Vec3::y() + 0.15 * above, above),
        (0.15 * beside + 0.02 * above, beside),
        (rim, slant),
    ];
    for (foot, normal) in places {
        for gap in [0.01, 0.0, -0.02] {
            let there = Pose::new(Mat3::identity(), foot + (0.1 + gap) * normal);
            let points = between(&ball, &body, &there, &Pose::identity(), 0.05).unwrap();
            assert_eq!(points.len(), 1, "{points:#?}");
            assert!((points[0].gap - gap).abs() < 1e-15 && points[0].weight == 1.0);
            assert!((points[0].normal - normal).norm() < 1e-14);
            assert!((points[0].position - foot - 0.5 * gap * normal).norm() < 1e-15);
        }
    }
}

#[test]
fn two_cylinders_meet_at_known_points() {
    let (a, b) = (
        plain(&Shape::cylinder(0.2, 1.0)),
        plain(&Shape::cylinder(0.1, 0.6)),
    );
    let o = Pose::identity();
    let found = |pose: Pose| between(&b, &a, &pose, &o, 0.01).unwrap();
    // Across one another, side to side: one point.
    let points = found(turned([FRAC_PI_2, 0.0, 0.0], [0.302, 0.05, 0.1]));
    assert_eq!(points.len(), 1, "{points:#?}");
    assert!((points[0].gap - 2e-3).abs() < 1e-15 && (points[0].normal - Vec3::x()).norm() < 1e-15);
    assert!((points[0].position - Vec3::new(0.201, 0.0, 0.1)).norm() < 1e-15);
    // Side by side: a line, of two.
    let points = found(at(0.302, 0.0, 0.1));
    assert!(
        points.iter().all(|p| (p.gap - 2e-3).abs() < 1e-14),
        "{points:#?}"
    );
    assert!(points.iter().all(|p| (p.normal - Vec3::x()).norm() < 1e-12));
    assert_eq!(points.iter().map(|p| p.weight).sum::<f64>(), 2.0);
    // End on end: the points in place of the smaller; and half aside, where the rims cross too.
    let points = found(at(0.02, 0.0, 0.803));
    assert_eq!(points.len(), RIM_POINTS);
    assert!(
        points
            .iter()
            .all(|p| (p.gap - 3e-3).abs() < 1e-15 && p.weight == 1.0)
    );
    let points = found(at(0.25, 0.0, 0.803));
    assert!(points.iter().all(|p| p.gap >= 3e-3 - 1e-15));
    let rims = |p: &&ContactPoint| {
        let x = p.position;
        let on = |x: f64, y: f64, r: f64| (x.hypot(y) - r).abs() < 1e-12;
        on(x.x, x.y, 0.2) && on(x.x - 0.25, x.y, 0.1) && p.weight == 1.0
    };
    assert_eq!(points.iter().filter(rims).count(), 4, "{points:#?}");
}

#[test]
fn the_least_gap_is_the_distance() {
    let mut draw = Draw::new(61);
    let cylinders = [
        cylinder(),
        Shape::cylinder(0.2, 0.03),
        Shape::cylinder(0.03, 0.5),
    ];
    let (mut pairs, mut worst, mut off) = (0, 0.0f64, 0);
    for first in &cylinders {
        for second in every_kind().iter().chain(&cylinders) {
            for n in 0..30 {
                let (from, rest) = (draw.pose(), draw.pose());
                let (a, b) = (plain(first), plain(second));
                let away = draw.vector().normalize();
                let mut pose = approach(&a, &b, &from, &rest, &away, 0.02);
                pose.translation += 0.01 * draw.vector();
                let exact = distance(first, &pose, second, &rest);
                if exact < 1e-4 {
                    continue;
                }
                pairs += 1;
                let found = least(&between(&a, &b, &pose, &rest, 0.5).unwrap());
                let error = found - exact;
                // Crossings near an end have faded.
                assert!(
                    (-1e-11..1e-2).contains(&error),
                    "{n} {first:?} {second:?}: {error:e} {exact}"
                );
                off += usize::from(error > 1e-10);
                if error <= 1e-10 {
                    worst = worst.max(error.abs());
                }
            }
        }
    }
    println!("{pairs} pairs: {off} farther than they are, the others off by {worst:.1e} m at most");
    assert!(pairs > 500 && 20 * off < pairs, "{pairs} {off}");
}

#[test]
fn slopes_agree_with_differences_where_cylinders_stand_and_lie() {
    let mut draw = Draw::new(67);
    let body = Shape::cylinder(0.15, 0.3);
    let beds = [
        Shape::cuboid([0.6, 0.5, 0.2]),
        Shape::cuboid([0.1, 0.8, 0.2]),
        Shape::cylinder(0.2, 0.2),
        Shape::capsule(0.1, 0.6),
        Shape::ellipsoid([0.4, 0.3, 0.1]),
    ];
    let (mut points, mut faded) = (0, 0);
    for bed in &beds {
        for tilt in [0.0, 0.01, 0.04, 0.09, 0.3, 0.8] {
            for aside in [0.0, 0.12, 0.25] {
                let (a, b) = (plain(&body), plain(bed));
                let on_side = if matches!(bed, Shape::Capsule { .. }) {
                    FRAC_PI_2
                } else {
                    0.0
                };
                let rest = turned([on_side, 0.0, 0.0], [0.0; 3]);
                let rest = Pose::new(
                    exp_matrix(&(0.005 * draw.vector())) * rest.rotation,
                    0.01 * draw.vector(),
                );
                let lean = draw.vector();
                let lean = tilt * Vec3::new(lean.x, lean.y, 0.0).normalize();
                let turn = exp_matrix(&lean) * exp_matrix(&Vec3::new(0.0, 0.0, draw.number()));
                let low = 0.15 * f64::cos(tilt) + 0.15 * f64::sin(tilt);
                let x = Vec3::new(aside, 0.3 * aside, 0.1 + low + 2e-3);
                let pose = Pose::new(turn, x + 1e-3 * draw.vector());
                let evaluate = |g: &Pose| between(&a, &b, g, &rest, 0.05).unwrap();
                let here = evaluate(&pose);
                points += here.len();
                faded += here.iter().filter(|p| p.weight < 1.0).count();
                let error = slope_error(evaluate, &pose);
                assert!(error < 1e-6, "{bed:?} {tilt} {aside}: {error:e} {here:#?}");
            }
        }
        for tilt in [0.01, 0.05, 0.2] {
            let a = plain(&body);
            let pose = turned([tilt, 0.3 * tilt, 0.0], [0.1, 0.2, 0.16]);
            let evaluate = |g: &Pose| against_wall(&a, &floor(), g, 1.0).unwrap();
            let error = slope_error(evaluate, &pose);
            assert!(error < 1e-6, "wall {tilt}: {error:e}");
        }
    }
    println!("{points} points, {faded} faded");
    assert!(points > 350 && faded > 150, "{points} {faded}");
}

#[test]
fn an_edge_that_sinks_into_a_rim_keeps_its_point() {
    let (body, bar) = (
        plain(&Shape::cylinder(0.15, 0.3)),
        plain(&Shape::cuboid([0.8, 0.1, 0.1])),
    );
    // An edge of the bar up, along x; the rim slants down over it.
    let rest = turned([FRAC_PI_4, 0.0, 0.0], [0.0; 3]);
    let top = 0.1 / 2f64.sqrt();
    let turn = exp_matrix(&Vec3::new(0.0, 0.8, 0.0)) * exp_matrix(&Vec3::new(0.3, 0.0, 0.0));
    let low = |pose: &Pose| {
        let n = Vec3::z();
        let down = pose.rotation.tr_mul(&-n);
        pose.translation.z - 0.15 * down.xy().norm() - 0.15 * down.z.abs() - top
    };
    let mut last = f64::NAN;
    for k in 0..60 {
        let mut pose = Pose::new(turn, Vec3::new(0.01, 0.0, 0.5));
        pose.translation.z -= low(&pose) + (k as f64 - 30.0) * 2e-4;
        let down = pose.rotation.tr_mul(&-Vec3::z());
        let rim = Vec3::new(down.x, down.y, 0.0).normalize() * 0.15;
        let lowest = pose.apply(&Vec3::new(rim.x, rim.y, 0.15f64.copysign(down.z)));
        pose.translation.y -= lowest.y + 1e-3;
        let evaluate = |g: &Pose| between(&body, &bar, g, &rest, 0.05).unwrap();
        let points = evaluate(&pose);
        let gap = least(&points);
        // The lowest point is over the edge's end to second order: its height is the gap.
        assert!(
            (gap + (k as f64 - 30.0) * 2e-4).abs() < 1e-3,
            "{k} {gap:e} {points:#?}"
        );
        assert!(
            last.is_nan() || (gap - last + 2e-4).abs() < 5e-5,
            "{k}: {last:e} {gap:e}"
        );
        assert!(points.iter().all(is_finite));
        last = gap;
        if k != 30 {
            let error = slope_error(evaluate, &pose);
            assert!(error < 1e-6, "{k}: {error:e} {points:#?}");
        }
    }
}

/// The greatest change of a force over its step, at two steps: a jump would make that four times as large at the shorter one.
fn steepest(push: impl Fn(f64) -> Vec6) -> [f64; 2] {
    [4e-5, 1e-5].map(|step: f64| {
        let mut last = push(0.0);
        let mut greatest: f64 = 0.0;
        for k in 1..=(1.0 / step) as usize {
            let next = push(step * k as f64);
            greatest = greatest.max((next - last).norm() / step);
            last = next;
        }
        greatest
    })
}

fn wrench(points: &[ContactPoint], reach: f64) -> Vec6 {
    let each = points.iter().map(|p| {
        let force = p.weight * (reach - p.gap).max(0.0) * p.normal;
        let torque = p.position.cross(&force);
        Vec6::from_iterator(force.iter().chain(torque.iter()).copied())
    });
    each.sum()
}

#[test]
fn a_cylinder_that_tips_rolls_and_slides_off_feels_no_jump() {
    let body = plain(&Shape::cylinder(0.15, 0.3));
    let bed = plain(&Shape::cuboid([0.7, 0.5, 0.2]));
    let stool = plain(&Shape::cylinder(0.2, 0.2));
    let reach = 0.02;
    // From one side over upright to the other, turning; a little above a wall all the way.
    let tipping = |t: f64| {
        let tilt = 0.3 * (t - 0.5);
        let turn = exp_matrix(&Vec3::new(tilt, 0.001, 0.0)) * exp_matrix(&Vec3::new(0.0, 0.0, t));
        let low = 0.15 * f64::cos(tilt) + 0.15 * f64::sin(tilt).abs();
        let pose = Pose::new(turn, Vec3::new(0.0, 0.0, low + 1e-3));
        wrench(&against_wall(&body, &floor(), &pose, reach).unwrap(), reach)
    };
    let rolling = |t: f64| {
        let turn = exp_matrix(&Vec3::new(FRAC_PI_2 + 0.02 * (t - 0.5), 0.0, 0.0));
        let turn = turn * exp_matrix(&Vec3::new(0.0, 0.0, TAU * t));
        let pose = Pose::new(turn, Vec3::new(0.0, 0.0, 0.151));
        wrench(&against_wall(&body, &floor(), &pose, reach).unwrap(), reach)
    };
    // Standing, off the edge of a box and of a lower cylinder, turning and leaning a little.
    let sliding = |under: &ContactShape, lean: f64, t: f64| {
        let turn =
            exp_matrix(&Vec3::new(lean, 0.5 * lean, 0.0)) * exp_matrix(&Vec3::new(0.0, 0.0, t));
        let pose = Pose::new(turn, Vec3::new(0.6 * t, 0.1 * t, 0.252 + 0.15 * lean));
        wrench(
            &between(&body, under, &pose, &Pose::identity(), reach).unwrap(),
            reach,
        )
    };
    let results = [
        ("tipping", steepest(tipping)),
        ("rolling", steepest(rolling)),
        ("off a box", steepest(|t| sliding(&bed, 1e-3, t))),
        ("off a box, leaning", steepest(|t| sliding(&bed, 0.03, t))),
        ("off a cylinder", steepest(|t| sliding(&stool, 1e-3, t))),
        (
            "off a cylinder, leaning",
            steepest(|t| sliding(&stool, 0.03, t)),
        ),
    ];
    for (name, [coarse, fine]) in results {
        println!("{name}: steepest change of force {coarse:.3} {fine:.3}");
        assert!(
            fine < 2.0 * coarse + 1e-6 && fine < 250.0,
            "{name} {coarse} {fine}"
        );
    }
}
