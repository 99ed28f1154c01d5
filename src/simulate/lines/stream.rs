//! Streamlines: by the pair of Dormand and Prince, all lines side by side.
//!
//! # References
//! J. R. Dormand, P. J. Prince, J. Comput. Appl. Math. 6 (1980) 19–26.

use super::field::Field;
use super::line::{LineEnd, Streamline, StreamlineSettings, Way};
use crate::Result;
use crate::adjoint::lie::Vec3;

/// Coefficients of the stages; the last row is the step itself.
const STAGES: [&[f64]; 6] = [
    &[1.0 / 5.0],
    &[3.0 / 40.0, 9.0 / 40.0],
    &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
    &[
        19372.0 / 6561.0,
        -25360.0 / 2187.0,
        64448.0 / 6561.0,
        -212.0 / 729.0,
    ],
    &[
        9017.0 / 3168.0,
        -355.0 / 33.0,
        46732.0 / 5247.0,
        49.0 / 176.0,
        -5103.0 / 18656.0,
    ],
    &[
        35.0 / 384.0,
        0.0,
        500.0 / 1113.0,
        125.0 / 192.0,
        -2187.0 / 6784.0,
        11.0 / 84.0,
    ],
];
/// Weights of the step less those of fourth order.
const ERROR: [f64; 7] = [
    71.0 / 57600.0,
    0.0,
    -71.0 / 16695.0,
    71.0 / 1920.0,
    -17253.0 / 339200.0,
    22.0 / 525.0,
    -1.0 / 40.0,
];

/// Longest step, of the length: a line shows its shape.
const LONGEST: f64 = 0.02;
/// Shortest step, of the length.
const SHORTEST: f64 = 1e-7;
/// Speed under which water stands still, m/s.
const STILL: f64 = 1e-12;
/// What of a step that would just do is taken, and by how much it may change.
const SAFE: f64 = 0.9;
const CHANGE: [f64; 2] = [0.2, 5.0];

/// A line as it grows one way.
struct Growing {
    points: Vec<Vec3>,
    velocities: Vec<Vec3>,
    step: f64,
    length: f64,
    tries: usize,
    end: Option<LineEnd>,
}

impl Growing {
    fn last(&self) -> (Vec3, Vec3) {
        let k = self.points.len() - 1;
        (self.points[k], self.velocities[k])
    }
}

/// Lines through seeds where the flow is known.
pub(super) fn lines(
    field: &Field,
    seeds: &[Vec3],
    settings: &StreamlineSettings,
) -> Result<Vec<Streamline>> {
    let first: Vec<Vec3> = (field.at(seeds)?.into_iter())
        .map(Option::unwrap_or_default)
        .collect();
    let grown = |sign: f64| grow(field, seeds, &first, sign, settings);
    let none = || -> Vec<Option<Growing>> { seeds.iter().map(|_| None).collect() };
    let some = |lines: Vec<Growing>| lines.into_iter().map(Some).collect();
    let up = match settings.way {
        Way::Forward => none(),
        Way::Backward | Way::Both => some(grown(-1.0)?),
    };
    let down = match settings.way {
        Way::Backward => none(),
        Way::Forward | Way::Both => some(grown(1.0)?),
    };
    let join = |(k, (up, down)): (usize, (Option<Growing>, Option<Growing>))| {
        let ends = [&up, &down].map(|line| line.as_ref().and_then(|line| line.end.clone()));
        let parts = |line: Option<Growing>| {
            line.map_or_else(
                || (vec![seeds[k]], vec![first[k]]),
                |line| (line.points, line.velocities),
            )
        };
        let (mut points, mut velocities) = parts(up);
        points.reverse();
        velocities.reverse();
        let seed = points.len() - 1;
        let (more, faster) = parts(down);
        points.extend_from_slice(&more[1..]);
        velocities.extend_from_slice(&faster[1..]);
        Streamline {
            points,
            velocities,
            seed,
            ends,
        }
    };
    Ok(up.into_iter().zip(down).enumerate().map(join).collect())
}

/// All lines one way.
fn grow(
    field: &Field,
    seeds: &[Vec3],
    first: &[Vec3],
    sign: f64,
    settings: &StreamlineSettings,
) -> Result<Vec<Growing>> {
    let start = |(x, u): (&Vec3, &Vec3)| Growing {
        points: vec![*x],
        velocities: vec![*u],
        step: 0.1 * LONGEST * settings.length,
        length: 0.0,
        tries: 0,
        end: match (u.norm() > STILL, outside(x, settings)) {
            (_, true) => Some(LineEnd::Box),
            (false, _) => Some(LineEnd::Still),
            _ => None,
        },
    };
    let mut lines: Vec<Growing> = seeds.iter().zip(first).map(start).collect();
    loop {
        let mut active: Vec<&mut Growing> = lines.iter_mut().filter(|l| l.end.is_none()).collect();
        if active.is_empty() {
            return Ok(lines);
        }
        step(field, &mut active, sign, settings)?;
    }
}

/// One step of every line, of which some are too long and taken again.
fn step(
    field: &Field,
    lines: &mut [&mut Growing],
    sign: f64,
    settings: &StreamlineSettings,
) -> Result<()> {
    let steps: Vec<f64> = (lines.iter())
        .map(|line| line.step.min(settings.length - line.length))
        .collect();
    let direction = |u: &Vec3| (u.norm() > STILL).then(|| sign * u.normalize());
    let mut slopes: Vec<Vec<Vec3>> = (lines.iter())
        .map(|line| direction(&line.last().1).into_iter().collect())
        .collect();
    let mut trials: Vec<Vec3> = lines.iter().map(|line| line.last().0).collect();
    let mut speeds = vec![Vec3::zeros(); lines.len()];
    // Of a stage where the flow isn't known: what is there.
    let mut failed: Vec<Option<LineEnd>> = vec![None; lines.len()];
    for stage in STAGES {
        let going: Vec<usize> = (0..lines.len()).filter(|k| failed[*k].is_none()).collect();
        for k in &going {
            let moved = slopes[*k].iter().zip(stage).map(|(d, a)| *a * d);
            trials[*k] = lines[*k].last().0 + steps[*k] * moved.sum::<Vec3>();
        }
        let places: Vec<Vec3> = going.iter().map(|k| trials[*k]).collect();
        for (k, found) in going.into_iter().zip(field.at(&places)?) {
            match (found, found.as_ref().and_then(direction)) {
                (Some(u), Some(d)) => {
                    speeds[k] = u;
                    slopes[k].push(d);
                }
                (Some(_), None) => failed[k] = Some(LineEnd::Still),
                (None, _) => failed[k] = Some(field.obstacle(&trials[k])),
            }
        }
    }
    let tolerance = settings.tolerance();
    for (k, line) in lines.iter_mut().enumerate() {
        line.tries += 1;
        let shortest = SHORTEST * settings.length;
        match failed[k].take() {
            Some(end) if steps[k] <= shortest => line.end = Some(end),
            Some(_) => line.step = 0.5 * steps[k],
            None => {
                let error: Vec3 = slopes[k].iter().zip(ERROR).map(|(d, e)| e * d).sum();
                let error = steps[k] * error.norm() / tolerance;
                let factor = SAFE * error.max(1e-10).powf(-0.2);
                let next = steps[k] * factor.clamp(CHANGE[0], CHANGE[1]);
                if error <= 1.0 || steps[k] <= shortest {
                    line.length += steps[k];
                    accept(line, (trials[k], speeds[k]), settings);
                }
                line.step = next.clamp(shortest, LONGEST * settings.length);
            }
        }
        if line.end.is_none() && line.tries >= settings.most_steps {
            line.end = Some(LineEnd::Steps);
        }
    }
    Ok(())
}

/// Adds a point, or that where the line leaves the box.
fn accept(line: &mut Growing, (point, velocity): (Vec3, Vec3), settings: &StreamlineSettings) {
    let (from, slower) = line.last();
    let part = settings.within.map_or(1.0, |corners| {
        let axes = (0..3).map(|c| {
            let (low, high, way) = (corners[0][c], corners[1][c], point[c] - from[c]);
            let limit = if way > 0.0 { high } else { low };
            match point[c] < low || point[c] > high {
                true => ((limit - from[c]) / way).clamp(0.0, 1.0),
                false => 1.0,
            }
        });
        axes.fold(1.0, f64::min)
    });
    line.points.push(from + part * (point - from));
    line.velocities.push(slower + part * (velocity - slower));
    // To rounding a line is then as long as it was asked to be.
    if part < 1.0 {
        line.end = Some(LineEnd::Box);
    } else if line.length >= settings.length * (1.0 - 1e-12) {
        line.end = Some(LineEnd::Length);
    }
}

fn outside(x: &Vec3, settings: &StreamlineSettings) -> bool {
    settings
        .within
        .is_some_and(|[low, high]| (0..3).any(|c| x[c] < low[c] || x[c] > high[c]))
}
