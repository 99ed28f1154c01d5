//! Places found among bodies whose boxes meet are those found among all pairs: the same bits, in the same order.

use super::*;
use hydrograd::contact::{ContactPair, Contacts};
use hydrograd::geometry::{Pairing, Wall};

/// Balls, ellipsoids, boxes, thin plates, cylinders, and bodies of two pieces.
fn shapes(draw: &mut Draw, count: usize) -> Vec<Vec<ContactShape>> {
    let kinds = [
        Shape::sphere(0.2),
        Shape::ellipsoid([0.3, 0.2, 0.1]),
        Shape::cuboid([0.3, 0.2, 0.4]),
        Shape::cuboid([0.6, 0.6, 0.01]),
        cylinder(),
        wedge(),
    ];
    let body = |b: usize| match b % 9 {
        7 => Vec::new(),
        8 => (0..2)
            .map(|_| offset(draw.pick(&kinds), draw.pose()))
            .collect(),
        _ => vec![plain(draw.pick(&kinds))],
    };
    (0..count).map(body).collect()
}

#[test]
fn neighbours_are_enough() {
    let mut draw = Draw::new(31);
    let walls = [
        Wall::rigid([0.0, 0.0, -2.0], [0.0, 0.0, 1.0]),
        Wall::rigid([2.0, 0.0, 0.0], [-1.0, 0.1, 0.0]),
    ];
    let (mut found, mut looked, mut all) = (0, 0, 0);
    for (count, spread) in [(6, 0.5), (20, 1.0), (60, 1.5), (120, 3.0), (200, 4.0)] {
        let shapes = shapes(&mut draw, count);
        let pairing = Pairing::all(count).but([(2, 0), (3, 4)]);
        let contacts = Contacts::new(shapes, &walls, pairing).unwrap();
        let poses: Vec<Pose> = (0..count)
            .map(|_| {
                turned(
                    (3.0 * draw.vector()).into(),
                    (spread * draw.vector()).into(),
                )
            })
            .collect();
        for distance in [0.0, 0.05, 0.4] {
            let points = |pairs: &[ContactPair]| {
                let each = pairs.iter().map(|pair| {
                    // Of bodies deep in one another none may be found.
                    let points = contacts.points(pair, &poses, distance).ok();
                    (*pair, format!("{points:?}"))
                });
                let each = each.filter(|(_, points)| points != "Some([])");
                each.collect::<Vec<_>>()
            };
            let pairs: Vec<ContactPair> = contacts.pairs().collect();
            assert!(pairs.is_sorted());
            let near = contacts.near(&poses, |b| 0.5 * distance + contacts.share_ahead(b));
            assert!(near.is_sorted());
            let whole = points(&pairs);
            assert_eq!(points(&near), whole);
            found += whole.len();
            looked += near.len();
            all += pairs.len();
        }
    }
    println!("{found} pairs are near, {looked} of {all} were looked at");
    assert!(found > 1000 && looked < all / 4, "{found} {looked} {all}");
}

/// A pose that isn't finite is near everything, so that the first pair of it tells.
#[test]
fn what_is_nowhere_is_near_all() {
    let mut draw = Draw::new(32);
    let contacts = Contacts::new(shapes(&mut draw, 40), &[], Pairing::all(40)).unwrap();
    let mut poses: Vec<Pose> = (0..40).map(|b| at(10.0 * f64::from(b), 0.0, 0.0)).collect();
    poses[4].translation.y = f64::NAN;
    let near = contacts.near(&poses, |_| 0.0);
    let all: Vec<_> = (contacts.pairs())
        .filter(|p| p.first == 4 || p.second_body() == Some(4))
        .collect();
    let of_four = near
        .iter()
        .filter(|p| p.first == 4 || p.second_body() == Some(4));
    assert_eq!(of_four.copied().collect::<Vec<_>>(), all);
    assert!(contacts.points(&near[0], &poses, 0.0).is_err());
}
