//! The sweep from the last knot to the first: the quadratic model of what is still to come, and the controls that are best by it.
//!
//! With z = (x, p), p the controls of the knot before, which changes of controls need, the model of a knot is
//!
//! ```text
//! Q(δx, δp, δu) = ℓ(δx, δu) + |δu − δp + ū − p̄|²_c + V'(A δx + B δu, δu)
//! ```
//!
//! which a projected Newton step makes least within the limits of u; V(δx, δp) is what is left of it under δu = k + K_x δx + K_p δp.

use super::box_qp::box_qp;
use crate::optimize::cost::Quadratic;
use nalgebra::{DMatrix, DVector};

/// One knot, linearised.
pub(super) struct KnotModel {
    /// Of the next knot's state by this one's, 2nv × 2nv.
    pub a: DMatrix<f64>,
    /// By the controls.
    pub b: DMatrix<f64>,
    pub cost: Quadratic,
    /// Twice the weights of the change of the controls from the knot before, and the change; none where it doesn't count.
    pub change: Option<(DVector<f64>, DVector<f64>)>,
    /// What the limits leave of each control's change.
    pub lower: DVector<f64>,
    pub upper: DVector<f64>,
}

/// The best change of a knot's controls, and how it answers to changes before.
#[derive(Clone, Debug)]
pub(super) struct Answer {
    /// k.
    pub step: DVector<f64>,
    /// K_x, controls × 2nv.
    pub gain: DMatrix<f64>,
    /// K_p, controls × controls; none where changes of controls cost nothing.
    pub of_previous: Option<DMatrix<f64>>,
    /// Controls that a limit holds.
    pub held: Vec<bool>,
}

/// What the sweep yields.
pub(super) struct Backward {
    pub answers: Vec<Answer>,
    /// Change of the cost that is expected: α times the first and α² times the second number for the part α of a step.
    pub expected: [f64; 2],
}

impl Backward {
    /// By how much a whole step is expected to lower the cost.
    pub fn fall(&self) -> f64 {
        -(self.expected[0] + self.expected[1])
    }
}

/// V: what is still to come.
struct Ahead {
    x: DVector<f64>,
    p: DVector<f64>,
    xx: DMatrix<f64>,
    xp: DMatrix<f64>,
    pp: DMatrix<f64>,
}

/// Part of the largest curvature that every control's has, so that one without any can be regularised.
const FLOOR: f64 = 1e-12;

/// Sweeps; `regularisation` makes the curvature of each control larger by that part of it, as Marquardt does, which needs no common unit of the controls. None where it
/// is too small for the model to have a least point.
pub(super) fn backward(
    knots: &[KnotModel],
    last: &Quadratic,
    regularisation: f64,
) -> Option<Backward> {
    let (n, m) = (last.x.len(), last.u.len());
    let couples = knots.iter().any(|k| k.change.is_some());
    let mut ahead = Ahead {
        x: last.x.clone(),
        p: DVector::zeros(m),
        xx: last.xx.clone(),
        xp: DMatrix::zeros(n, m),
        pp: DMatrix::zeros(m, m),
    };
    let mut answers = Vec::with_capacity(knots.len());
    let mut expected = [0.0; 2];
    for knot in knots.iter().rev() {
        let (a, b, cost) = (&knot.a, &knot.b, &knot.cost);
        let (va, vb) = (&ahead.xx * a, &ahead.xx * b);
        let qx = &cost.x + a.tr_mul(&ahead.x);
        let mut qu = &cost.u + b.tr_mul(&ahead.x);
        let qxx = &cost.xx + a.tr_mul(&va);
        let mut quu = &cost.uu + b.tr_mul(&vb);
        let mut qux = &cost.ux + b.tr_mul(&va);
        if couples {
            let through = b.tr_mul(&ahead.xp);
            qu += &ahead.p;
            quu += &through + through.transpose() + &ahead.pp;
            qux += ahead.xp.tr_mul(a);
        }
        if let Some((weights, change)) = &knot.change {
            qu += weights.component_mul(change);
            for i in 0..m {
                quu[(i, i)] += weights[i];
            }
        }
        symmetrise(&mut quu);
        let mut model = quu.clone();
        let most = (0..m).fold(0.0_f64, |most, i| most.max(quu[(i, i)].abs()));
        let floor = if most > 0.0 { FLOOR * most } else { 1.0 };
        for i in 0..m {
            model[(i, i)] += regularisation * quu[(i, i)].abs().max(floor);
        }
        let found = box_qp(&model, &qu, &knot.lower, &knot.upper)?;
        let free = &found.free;
        // −Q_uu⁻¹ of rows of what is free; none of what a limit holds.
        let answer = |rows: &DMatrix<f64>| {
            let mut out = DMatrix::zeros(m, rows.ncols());
            if let Some(factor) = &found.factor {
                let own = DMatrix::from_fn(free.len(), rows.ncols(), |k, j| -rows[(free[k], j)]);
                let solved = factor.solve(&own);
                for (k, i) in free.iter().enumerate() {
                    out.row_mut(*i).copy_from(&solved.row(k));
                }
            }
            out
        };
        let step = found.x.clone();
        let gain = answer(&qux);
        let curved = &quu * &step;
        expected[0] += step.dot(&qu);
        expected[1] += 0.5 * step.dot(&curved);
        let pull = &qu + &curved;
        let by_gain = &quu * &gain;
        let mut next = Ahead {
            x: qx + gain.tr_mul(&pull) + qux.tr_mul(&step),
            p: DVector::zeros(m),
            xx: qxx + gain.tr_mul(&(&by_gain + &qux)) + qux.tr_mul(&gain),
            xp: DMatrix::zeros(n, m),
            pp: DMatrix::zeros(m, m),
        };
        symmetrise(&mut next.xx);
        let mut of_previous = None;
        if let Some((weights, change)) = &knot.change {
            let qup = DMatrix::from_diagonal(&-weights);
            let own = answer(&qup);
            let curved_own = &quu * &own + &qup;
            next.p = -weights.component_mul(change) + own.tr_mul(&pull) + qup.tr_mul(&step);
            next.xp = gain.tr_mul(&curved_own) + qux.tr_mul(&own);
            next.pp = DMatrix::from_diagonal(weights) + own.tr_mul(&curved_own) + qup.tr_mul(&own);
            symmetrise(&mut next.pp);
            of_previous = Some(own);
        }
        let mut held = vec![true; m];
        free.iter().for_each(|i| held[*i] = false);
        answers.push(Answer {
            step,
            gain,
            of_previous,
            held,
        });
        ahead = next;
    }
    answers.reverse();
    let finite = |a: &Answer| a.step.iter().chain(a.gain.iter()).all(|x| x.is_finite());
    answers
        .iter()
        .all(finite)
        .then_some(Backward { answers, expected })
}

fn symmetrise(m: &mut DMatrix<f64>) {
    for i in 0..m.nrows() {
        for j in 0..i {
            let mean = 0.5 * (m[(i, j)] + m[(j, i)]);
            (m[(i, j)], m[(j, i)]) = (mean, mean);
        }
    }
}

/// Gradient of the cost by the controls of every knot, from the same models.
pub(super) fn gradient(knots: &[KnotModel], last: &Quadratic) -> Vec<DVector<f64>> {
    let mut bar = last.x.clone();
    let mut out = Vec::with_capacity(knots.len());
    // Of the change of the controls at the knot after.
    let mut after = DVector::zeros(last.u.len());
    for knot in knots.iter().rev() {
        let mut own = &knot.cost.u + knot.b.tr_mul(&bar) - &after;
        after.fill(0.0);
        if let Some((weights, change)) = &knot.change {
            after = weights.component_mul(change);
            own += &after;
        }
        bar = &knot.cost.x + knot.a.tr_mul(&bar);
        out.push(own);
    }
    out.reverse();
    out
}
