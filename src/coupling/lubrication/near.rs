//! Which of many bearings may have water in them: those of bodies whose boxes are near.

use super::Bearing;
use crate::adjoint::lie::Pose;
use crate::geometry::{Casing, Neighbours};

/// Bearings between bodies, and bodies and walls, by their numbers.
pub(crate) struct NearBearings {
    /// Of each, m.
    reaches: Vec<f64>,
    /// Those at walls, ascending.
    at_walls: Vec<usize>,
    /// The lower number of two bodies, the higher one, and that of a bearing between them: ascending.
    between: Vec<(usize, usize, usize)>,
    /// Of each body that has bearings with others: a box around it, and half of the farthest that one of them reaches, m.
    boxes: Vec<Option<(Casing, f64)>>,
}

impl NearBearings {
    /// Of so many bodies; of each bearing the body on whose surface it is solved, and the other one, none for a wall.
    pub fn new<'b>(
        bodies: usize,
        all: impl Iterator<Item = (usize, Option<usize>, &'b Bearing)>,
    ) -> Self {
        let mut out = Self {
            reaches: Vec::new(),
            at_walls: Vec::new(),
            between: Vec::new(),
            boxes: vec![None; bodies],
        };
        for (number, (first, second, bearing)) in all.enumerate() {
            out.reaches.push(bearing.reach);
            let Some(second) = second else {
                out.at_walls.push(number);
                continue;
            };
            let pair = (first.min(second), first.max(second), number);
            out.between.push(pair);
            // The surface's box holds what is opposite to others, too.
            let own = Some(bearing.surface.casing);
            out.widen(first, own, bearing.reach);
            let known = out.boxes[second].map(|(casing, _)| casing);
            let other = known.or_else(|| bearing.opposite.casing());
            out.widen(second, other, bearing.reach);
        }
        out.between.sort_unstable();
        out
    }

    fn widen(&mut self, body: usize, casing: Option<Casing>, reach: f64) {
        let before = self.boxes[body].map_or(0.0, |(_, reach)| reach);
        self.boxes[body] = casing.map(|casing| (casing, before.max(0.5 * reach)));
    }

    /// Numbers of those that may have water in them at these poses, ascending.
    pub fn at(&self, poses: &[Pose]) -> Vec<usize> {
        let regions = self.boxes.iter().zip(poses);
        let regions = regions.map(|(own, pose)| {
            let (casing, reach) = own.as_ref()?;
            Some(casing.region(pose, *reach))
        });
        let mut out = self.at_walls.clone();
        for (a, b) in Neighbours::new(regions.collect()).pairs() {
            let from = self.between.partition_point(|(i, j, _)| (*i, *j) < (a, b));
            let own = self.between[from..].iter();
            let mut own = own.take_while(|(i, j, _)| (*i, *j) == (a, b)).peekable();
            let (Some(_), Some((x, _)), Some((y, _))) =
                (own.peek(), &self.boxes[a], &self.boxes[b])
            else {
                continue;
            };
            let apart = x.apart_at(&poses[a], y, &poses[b]);
            let numbers = own.map(|(_, _, number)| *number);
            out.extend(numbers.filter(|n| apart <= self.reaches[*n]));
        }
        out.sort_unstable();
        out
    }
}
