//! What the checks share.

use hydrograd::adjoint::check::{Outcome, moved, norm, outcome, smallest_error};
use hydrograd::adjoint::sample;
use nalgebra::DVector;
use std::cell::RefCell;
use std::rc::Rc;

/// Largest accepted relative error.
pub const TOLERANCE: f64 = 1e-6;

thread_local! {
    /// What the checks of this thread drew.
    static DRAWN: RefCell<Vec<Vec<f64>>> = const { RefCell::new(Vec::new()) };
}

/// Fixed numbers between −`size` and `size`, of which all checks are made.
pub fn wavy(count: usize, phase: f64, size: f64) -> DVector<f64> {
    let drawn = sample::numbers(phase.to_bits(), count, size);
    DRAWN.with_borrow_mut(|all| all.push(drawn.clone()));
    DVector::from_vec(drawn)
}

/// A function of one number, whose derivative at 0 a check compares, as far as it is known.
struct Line {
    tangent: Vec<f64>,
    values: RefCell<Vec<(f64, Vec<f64>)>>,
}

impl Line {
    fn new(tangent: &[f64]) -> Rc<Self> {
        Rc::new(Self {
            tangent: tangent.to_vec(),
            values: RefCell::default(),
        })
    }

    fn at(&self, h: f64, value: impl Fn(f64) -> Vec<f64>) -> Vec<f64> {
        let known = |all: &Vec<(f64, Vec<f64>)>| all.iter().find(|v| v.0 == h).map(|v| v.1.clone());
        if let Some(found) = known(&self.values.borrow()) {
            return found;
        }
        let made = value(h);
        self.values.borrow_mut().push((h, made.clone()));
        made
    }

    /// Whether its tangent is this one without the corruption.
    fn corrupted_to(&self, tangent: &[f64], corruption: f64) -> bool {
        let own: Vec<f64> = self.tangent.iter().map(|t| corruption * t).collect();
        own.len() == tangent.len() && norm(&moved(&own, -1.0, tangent)) < 1e-9 * norm(&own)
    }
}

thread_local! {
    /// The lines of this thread's rung, and by what its derivatives are multiplied.
    static LINES: RefCell<(Vec<Rc<Line>>, f64)> = const { RefCell::new((Vec::new(), 1.0)) };
}

/// The line with this tangent. A corrupted check takes the values of the right one: the function is the same, and most of a check's time
/// goes into it.
fn line(tangent: &[f64]) -> Rc<Line> {
    LINES.with_borrow_mut(|(lines, corruption)| {
        if *corruption != 1.0 {
            let same = lines.iter().find(|l| l.corrupted_to(tangent, *corruption));
            return same.cloned().unwrap_or_else(|| Line::new(tangent));
        }
        let made = Line::new(tangent);
        lines.push(made.clone());
        made
    })
}

/// What a check gives on the rung itself and on one that is wrong by this factor, and what the first draws.
pub fn both(check: fn(f64) -> Outcome, wrong: f64) -> [(Outcome, Vec<Vec<f64>>); 2] {
    LINES.take();
    [1.0, wrong].map(|corruption| {
        LINES.with_borrow_mut(|l| l.1 = corruption);
        DRAWN.take();
        let outcome = check(corruption);
        (outcome, DRAWN.take())
    })
}

/// The worst of several checks.
pub fn all(outcomes: impl IntoIterator<Item = Outcome>) -> Outcome {
    outcomes
        .into_iter()
        .reduce(Outcome::worst)
        .expect("at least one check")
}

/// A scalar along a line against its slope at 0.
pub fn along(value: impl Fn(f64) -> f64, slope: f64) -> Outcome {
    vector_along(|h| vec![value(h)], &[slope])
}

/// A vector along a line against its tangent at 0.
pub fn vector_along(value: impl Fn(f64) -> Vec<f64>, tangent: &[f64]) -> Outcome {
    outcome_of(&line(tangent), value, tangent)
}

fn outcome_of(line: &Line, value: impl Fn(f64) -> Vec<f64>, tangent: &[f64]) -> Outcome {
    let f = |h: &[f64]| line.at(h[0], &value);
    if LINES.with_borrow(|l| l.1 != 1.0) {
        let rel_error = smallest_error(f, &[0.0], &[1.0], tangent, TOLERANCE);
        // It has failed: the order needn't be known.
        if rel_error > TOLERANCE {
            return Outcome {
                rel_error,
                order: f64::NAN,
                tolerance: TOLERANCE,
            };
        }
    }
    outcome(f, &[0.0], &[1.0], tangent, TOLERANCE)
}

/// One group of inputs: a direction's slope by the adjoint, and the scalar along it.
pub struct Group<'a> {
    pub name: &'static str,
    pub slope: f64,
    pub value: Box<dyn Fn(f64) -> f64 + 'a>,
}

/// Checks each group on its own, so that a large one can't hide a small one. Groups that the scalar
/// doesn't depend on must have no slope.
pub fn groups(list: Vec<Group>, corruption: f64) -> Outcome {
    let largest = list.iter().map(|g| g.slope.abs()).fold(0.0, f64::max);
    let mut out = None;
    for g in list {
        let line = line(&[corruption * g.slope]);
        let value = |h: f64| vec![(g.value)(h)];
        let [ahead, start, behind] = [1e-3, 0.0, -1e-3].map(|h| line.at(h, value)[0]);
        let (difference, start) = ((ahead - behind) / 2e-3, start.abs());
        if g.slope.abs() <= 1e-12 * largest && difference.abs() <= 1e-9 * largest + 1e-10 * start {
            continue;
        }
        let one = outcome_of(&line, value, &[corruption * g.slope]);
        if corruption == 1.0 && !one.passes() {
            println!(
                "group {}: slope {} difference {difference} {one:?}",
                g.name, g.slope
            );
        }
        // One group that fails is enough for a corrupted rung.
        if corruption != 1.0 && !one.passes() {
            return one;
        }
        out = Some(match out {
            None => one,
            Some(all) => one.worst(all),
        });
    }
    out.expect("a group that the scalar depends on")
}
