//! Path lines: tracers that go with the water from state to state.

use super::field::Field;
use super::line::{LineEnd, PathLine};
use crate::Result;
use crate::adjoint::lie::Vec3;
use crate::simulate::Rollout;

/// The flow at the middle of a step from that at the state before it and at its ends: a parabola in time.
const MIDDLE: [f64; 3] = [-0.125, 0.75, 0.375];

/// The ways of tracers; the flow is known at the seeds.
pub(super) fn lines(
    rollout: &Rollout,
    seeds: &[Vec3],
    from: usize,
    to: usize,
) -> Result<Vec<PathLine>> {
    let simulator = rollout.simulator();
    let dt = simulator.time_step();
    let field = |n: usize| {
        let sample = &rollout.samples()[n];
        Field::new(simulator, sample).map_err(|e| e.at_time(sample.time))
    };
    let mut here = field(from)?;
    let first = here.at(seeds)?;
    let start = |(x, u): (&Vec3, Option<Vec3>)| PathLine {
        points: vec![*x],
        velocities: vec![u.unwrap_or_default()],
        times: vec![here.time()],
        end: LineEnd::Length,
    };
    let mut lines: Vec<PathLine> = seeds.iter().zip(first).map(start).collect();
    // Tracers that go on.
    let mut going: Vec<usize> = (0..lines.len()).collect();
    let mut n = from;
    while n < to && !going.is_empty() {
        let next = field(n + 1)?;
        if n + 2 > to {
            let before = match n {
                0 => None,
                n => Some(field(n - 1)?),
            };
            let step = |_: &Field, x: &[Vec3]| middle(before.as_ref(), &here, &next, x);
            advance(
                &mut lines,
                going,
                (&here, &here, &next),
                dt,
                step,
                |_, _, _| (),
            )?;
            return Ok(lines);
        }
        let last = field(n + 2)?;
        let time = next.time();
        let between = |line: &mut PathLine, x: Vec3, u: Vec3| {
            // The cubic function through both ends with their velocities.
            let k = line.points.len() - 1;
            let (from, slower) = (line.points[k], line.velocities[k]);
            let span = 2.0 * dt;
            line.points
                .push(0.5 * (from + x) + 0.125 * span * (slower - u));
            line.velocities
                .push(1.5 / span * (x - from) - 0.25 * (slower + u));
            line.times.push(time);
        };
        let at_middle = |field: &Field, x: &[Vec3]| field.at(x);
        going = advance(
            &mut lines,
            going,
            (&here, &next, &last),
            2.0 * dt,
            at_middle,
            between,
        )?;
        here = last;
        n += 2;
    }
    Ok(lines)
}

/// One step of the tracers that go on by fields at its start, middle and end; those that go on after it. `between` adds what lies between.
fn advance(
    lines: &mut [PathLine],
    going: Vec<usize>,
    (start, middle, end): (&Field, &Field, &Field),
    span: f64,
    at_middle: impl Fn(&Field, &[Vec3]) -> Result<Vec<Option<Vec3>>>,
    between: impl Fn(&mut PathLine, Vec3, Vec3),
) -> Result<Vec<usize>> {
    let mut tracers: Vec<Tracer> = (going.into_iter())
        .map(|line| {
            let k = lines[line].points.len() - 1;
            let (x, u) = (lines[line].points[k], lines[line].velocities[k]);
            Tracer {
                line,
                from: x,
                slopes: vec![u],
                place: x,
            }
        })
        .collect();
    for (field, share) in [(middle, 0.5), (middle, 0.5), (end, 1.0)] {
        tracers
            .iter_mut()
            .for_each(|t| t.place = t.from + share * span * t.slopes[t.slopes.len() - 1]);
        let found = |x: &[Vec3]| match share < 1.0 {
            true => at_middle(field, x),
            false => field.at(x),
        };
        tracers = gone(tracers, lines, start, found)?;
    }
    for t in &mut tracers {
        let weighted = t.slopes.iter().zip([1.0, 2.0, 2.0, 1.0]);
        t.place = t.from + span / 6.0 * weighted.map(|(u, w)| w * u).sum::<Vec3>();
    }
    tracers = gone(tracers, lines, end, |x| end.at(x))?;
    let each = tracers.into_iter().map(|t| {
        let (line, u) = (&mut lines[t.line], t.slopes[t.slopes.len() - 1]);
        between(line, t.place, u);
        line.points.push(t.place);
        line.velocities.push(u);
        line.times.push(end.time());
        t.line
    });
    Ok(each.collect())
}

/// A tracer within a step.
struct Tracer {
    line: usize,
    from: Vec3,
    slopes: Vec<Vec3>,
    place: Vec3,
}

/// The tracers with the velocities at their places; lines of others end.
fn gone(
    tracers: Vec<Tracer>,
    lines: &mut [PathLine],
    field: &Field,
    found: impl Fn(&[Vec3]) -> Result<Vec<Option<Vec3>>>,
) -> Result<Vec<Tracer>> {
    let places: Vec<Vec3> = tracers.iter().map(|t| t.place).collect();
    let mut out = Vec::with_capacity(tracers.len());
    for (mut tracer, u) in tracers.into_iter().zip(found(&places)?) {
        match u {
            Some(u) => {
                tracer.slopes.push(u);
                out.push(tracer);
            }
            None => lines[tracer.line].end = field.obstacle(&tracer.place),
        }
    }
    Ok(out)
}

/// The flow at the middle of a single step.
fn middle(
    before: Option<&Field>,
    start: &Field,
    end: &Field,
    points: &[Vec3],
) -> Result<Vec<Option<Vec3>>> {
    let (a, b) = (start.at(points)?, end.at(points)?);
    let c = match before {
        Some(before) => before.at(points)?,
        None => vec![None; points.len()],
    };
    let each = c.into_iter().zip(a.into_iter().zip(b));
    Ok(each
        .map(|(before, (start, end))| {
            let (start, end) = (start?, end?);
            Some(match before {
                Some(before) => MIDDLE[0] * before + MIDDLE[1] * start + MIDDLE[2] * end,
                None => 0.5 * (start + end),
            })
        })
        .collect())
}
