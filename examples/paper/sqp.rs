//! Sequential quadratic programming: the least of a function where another is zero, in a box. Steps minimise a model with the curvature of the Lagrangian, learnt from gradients (BFGS), and the
//! square of the linearised condition, as far as a trust region goes.

use nalgebra::{DMatrix, DVector};

pub type Vector = DVector<f64>;

/// Weight of half the squared condition.
const WEIGHT: f64 = 20.0;
/// Trust region, largest entry of a step: at first, and at most.
const TRUST: [f64; 2] = [0.4, 1.0];
/// Steps shorter than this end the search.
const SHORTEST: f64 = 1e-3;
const SWEEPS: usize = 300;

/// Cost and condition at a point, with their gradients.
pub struct Point {
    pub cost: f64,
    pub cost_slope: Vector,
    pub condition: f64,
    pub condition_slope: Vector,
}

/// Bounds of the variables.
pub struct Bounds {
    pub low: Vector,
    pub high: Vector,
}

impl Bounds {
    /// The nearest point inside.
    pub fn nearest(&self, x: &Vector) -> Vector {
        x.zip_zip_map(&self.low, &self.high, f64::clamp)
    }
}

struct Search<'a> {
    bounds: &'a Bounds,
    x: Vector,
    at: Point,
    curvature: DMatrix<f64>,
    multiplier: f64,
    trust: f64,
}

/// Searches from `start`, with at most `most` evaluations; one that gives nothing has failed. What it finds is for `evaluate` to remember.
pub fn search(
    start: Vector,
    bounds: &Bounds,
    most: usize,
    mut evaluate: impl FnMut(&Vector) -> Option<Point>,
) {
    let Some(at) = evaluate(&start) else { return };
    let mut search = Search {
        curvature: DMatrix::identity(start.len(), start.len()),
        multiplier: 0.0,
        trust: TRUST[0],
        x: start,
        at,
        bounds,
    };
    search.multiplier = search.nearest_multiplier();
    for _ in 1..most {
        let step = search.step();
        if step.amax() < SHORTEST {
            return;
        }
        let next = search.bounds.nearest(&(&search.x + &step));
        let trial = evaluate(&next);
        search.judge(&step, next, trial);
    }
}

impl Search<'_> {
    fn lagrangian_slope(&self, point: &Point) -> Vector {
        &point.cost_slope - self.multiplier * &point.condition_slope
    }

    fn merit(&self, point: &Point) -> f64 {
        let c = point.condition;
        point.cost - self.multiplier * c + 0.5 * WEIGHT * c * c
    }

    /// Slope and curvature of the merit's model.
    fn model(&self) -> (Vector, DMatrix<f64>) {
        let by = &self.at.condition_slope;
        let slope = self.lagrangian_slope(&self.at) + WEIGHT * self.at.condition * by;
        (slope, &self.curvature + WEIGHT * by * by.transpose())
    }

    /// By least squares, of the variables that are off their bounds.
    fn nearest_multiplier(&self) -> f64 {
        let Bounds { low, high } = self.bounds;
        let mut sums = [0.0, 0.0];
        for i in (0..self.x.len()).filter(|&i| self.x[i] > low[i] && self.x[i] < high[i]) {
            let by = self.at.condition_slope[i];
            sums[0] += self.at.cost_slope[i] * by;
            sums[1] += by * by;
        }
        if sums[1] > 0.0 {
            sums[0] / sums[1]
        } else {
            self.multiplier
        }
    }

    /// Where the model is least, coordinate by coordinate.
    fn step(&self) -> Vector {
        let (slope, curvature) = self.model();
        let low = (&self.bounds.low - &self.x).map(|d| d.max(-self.trust));
        let high = (&self.bounds.high - &self.x).map(|d| d.min(self.trust));
        let mut step = Vector::zeros(self.x.len());
        for _ in 0..SWEEPS {
            for i in 0..step.len() {
                let along = slope[i] + curvature.column(i).dot(&step);
                step[i] = (step[i] - along / curvature[(i, i)]).clamp(low[i], high[i]);
            }
        }
        step
    }

    fn judge(&mut self, step: &Vector, next: Vector, trial: Option<Point>) {
        let length = step.amax();
        let Some(trial) = trial else {
            self.trust = 0.25 * length;
            return;
        };
        let (slope, curvature) = self.model();
        let promised = -slope.dot(step) - 0.5 * step.dot(&(&curvature * step));
        let kept = (self.merit(&self.at) - self.merit(&trial)) / promised;
        self.learn(step, &trial);
        if kept < 0.25 {
            self.trust = 0.5 * length;
        } else if kept > 0.75 && length > 0.99 * self.trust {
            self.trust = (2.0 * self.trust).min(TRUST[1]);
        }
        if kept > 0.0 {
            self.x = next;
            self.at = trial;
            self.multiplier = self.nearest_multiplier();
        }
    }

    /// BFGS, damped as by Powell.
    fn learn(&mut self, step: &Vector, trial: &Point) {
        let bent = &self.curvature * step;
        let had = step.dot(&bent);
        let seen = self.lagrangian_slope(trial) - self.lagrangian_slope(&self.at);
        let along = step.dot(&seen);
        let part = if along < 0.2 * had {
            0.8 * had / (had - along)
        } else {
            1.0
        };
        let taken = part * seen + (1.0 - part) * &bent;
        self.curvature +=
            &taken * taken.transpose() / step.dot(&taken) - &bent * bent.transpose() / had;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (x − 2)² + 3 (y + z)² + z⁴ where x y = 1, with x ≤ 1.5.
    fn point(x: &Vector) -> Point {
        let sum = 6.0 * (x[1] + x[2]);
        Point {
            cost: (x[0] - 2.0).powi(2) + sum * sum / 12.0 + x[2].powi(4),
            cost_slope: Vector::from_vec(vec![2.0 * (x[0] - 2.0), sum, sum + 4.0 * x[2].powi(3)]),
            condition: x[0] * x[1] - 1.0,
            condition_slope: Vector::from_vec(vec![x[1], x[0], 0.0]),
        }
    }

    #[test]
    fn finds_the_least_on_the_condition_and_in_the_box() {
        let bounds = Bounds {
            low: Vector::from_vec(vec![0.1, 0.1, -5.0]),
            high: Vector::from_vec(vec![1.5, 5.0, 5.0]),
        };
        let (mut last, mut made) = (Vector::zeros(3), 0);
        search(Vector::from_element(3, 1.0), &bounds, 60, |x| {
            last = x.clone();
            made += 1;
            // A trial that fails.
            (made != 3).then(|| point(x))
        });
        assert!((last[0] - 1.5).abs() < 1e-6 && (last[0] * last[1] - 1.0).abs() < 1e-4);
        let slope = 6.0 * (last[1] + last[2]) + 4.0 * last[2].powi(3);
        assert!(slope.abs() < 1e-2, "{last} {slope}");
        assert!(made < 40, "{made}");
    }
}
