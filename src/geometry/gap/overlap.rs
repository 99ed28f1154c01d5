//! What is said of bodies that overlap or touch.

use super::gaps::{Gap, Other};
use crate::error::Error;

/// The error of a gap that isn't positive: names both, says how deep and how to mend it.
/// `names` are those of the bodies; a body without name is called by its number.
pub fn overlap_error(gap: &Gap, names: &[impl AsRef<str>]) -> Error {
    let body = |i: usize| {
        names
            .get(i)
            .map_or_else(|| format!("body {i}"), |n| format!("body {:?}", n.as_ref()))
    };
    let first = body(gap.first);
    let depth = -gap.distance;
    let edge = gap.edge;
    let (place, remedy) = match gap.second {
        Other::Body(j) if depth > 0.0 => (
            format!("{first} and {}", body(j)),
            format!("they overlap: move them apart by at least {depth:.6e} m"),
        ),
        Other::Wall(w) if depth > 0.0 => (
            format!("{first} and wall {w}"),
            format!(
                "it reaches through the wall: move it into the fluid by at least {depth:.6e} m"
            ),
        ),
        Other::Body(j) => (
            format!("{first} and {}", body(j)),
            format!("they are too near: move them apart; edges there are {edge:.3e} m long"),
        ),
        Other::Wall(w) => (
            format!("{first} and wall {w}"),
            format!("it is too near: move it into the fluid; edges there are {edge:.3e} m long"),
        ),
    };
    Error::Unresolved {
        place,
        quantity: "gap in m".into(),
        value: gap.distance,
        limit: 0.0,
        remedy,
    }
}
