//! Files of compressed bodies: a changed one is never taken for the body, and one made up with a right digest never harms.

use super::engine::{Answer, fuzz};
use hydrograd::coupling::reduced::{CompressedParts, Fit, compress::CompressSettings};
use hydrograd::coupling::reduced::{ReducedBody, cache};
use hydrograd::shape;
use hydrograd::{Error, Shape};
use nalgebra::{DMatrix, Matrix6, Vector3};

fn body() -> ReducedBody {
    let points = (0..4).map(|k| Vector3::new(k as f64, 0.5, 0.25 * k as f64));
    let parts = CompressedParts {
        name: "a body".into(),
        points: points.collect(),
        modes: DMatrix::from_fn(4, 2, |i, j| (i + 2 * j) as f64 - 1.5),
        strengths: DMatrix::from_fn(4, 6, |i, j| (i * j) as f64),
        added_mass: Matrix6::identity(),
        centre: Vector3::zeros(),
        radius: 1.0,
        volume: 2.0,
        fit: Fit::default(),
    };
    ReducedBody::new(parts).unwrap()
}

fn key(of: &str) -> cache::Key {
    let mesh = shape::build(&Shape::sphere(1.0), "".as_ref(), Some(20)).unwrap();
    cache::Key::new(&mesh, &of, &CompressSettings::default(), &[])
}

/// What is made where a file isn't taken; it isn't kept.
fn unmade() -> hydrograd::Result<ReducedBody> {
    Err(Error::input("a body", "none", "not in the cache"))
}

#[test]
fn cached_bodies_hold() {
    let folder = tempfile::tempdir().unwrap();
    let (body, key) = (body(), key("fuzzed"));
    let file = cache::path(folder.path(), key);
    cache::fetch(key, Some(folder.path()), || Ok(body.clone())).unwrap();
    let whole = std::fs::read(&file).unwrap();
    fuzz("cache", vec![whole], 5_000, |input| {
        cache::forget();
        std::fs::write(&file, input).unwrap();
        match cache::fetch(key, Some(folder.path()), unmade) {
            Ok((found, _)) if *found == body => Answer::Taken(String::new()),
            Ok(_) => Answer::Wrong("another body".into()),
            Err(error) => Answer::Refused(error.to_string()),
        }
    });
}

/// Whoever can compute the digest can put anything there: it is taken or not, and never more than that.
#[test]
fn crafted_bodies_hold() {
    let text = serde_json::to_vec(&body()).unwrap();
    fuzz(
        "crafted",
        vec![text],
        10_000,
        |input| match serde_json::from_slice::<ReducedBody>(input) {
            Ok(found) => {
                let larger = found.scaled(2.0);
                match larger {
                    Ok(_) => Answer::Taken(format!("{} points", found.points())),
                    Err(error) => Answer::Refused(error.to_string()),
                }
            }
            Err(error) => Answer::Refused(error.to_string()),
        },
    );
}

/// Cut short at every byte, and with every bit turned: never taken, and never in the way.
#[test]
fn damaged_bodies_hold() {
    let folder = tempfile::tempdir().unwrap();
    let (body, key) = (body(), key("damaged"));
    let file = cache::path(folder.path(), key);
    let again = || {
        cache::forget();
        cache::fetch(key, Some(folder.path()), unmade)
    };
    cache::fetch(key, Some(folder.path()), || Ok(body.clone())).unwrap();
    let whole = std::fs::read(&file).unwrap();
    assert!(*again().unwrap().0 == body);
    for length in 0..whole.len() {
        std::fs::write(&file, &whole[..length]).unwrap();
        assert!(again().is_err(), "{length}");
    }
    for bit in 0..8 * whole.len() {
        let mut bytes = whole.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        std::fs::write(&file, bytes).unwrap();
        assert!(again().is_err(), "{bit}");
    }
    std::fs::write(&file, [&whole[..], b" "].concat()).unwrap();
    assert!(again().is_err());
    std::fs::write(&file, &whole).unwrap();
    assert!(*again().unwrap().0 == body);
}
