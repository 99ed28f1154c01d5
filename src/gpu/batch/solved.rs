//! One scene's evaluation among many, with its derivatives.

use super::question::{Kind, Question, STATUS};
use super::runner::Answer;
use super::seat::{FLUX, Found, Held, Seat, impulses, is_solved};
use crate::Result;
use crate::adjoint::lie::{Pose, Vec3, Vec6};
use crate::coupling::{
    CouplingReport, Direction, Linearise, Linearised, PairTensor, Pullback, Tangent,
};
use crate::gpu::columns::passes;
use crate::gpu::units::{Twists, motions, size, spatial};
use nalgebra::{DMatrix, DVector};
use std::sync::{Mutex, OnceLock, PoisonError};

/// Momenta of columns, and the wrenches of each.
type Responses = (DMatrix<f64>, Vec<Vec<Vec6>>);

/// [`Seat`] solved for a basis.
pub(super) struct SolvedTogether<'a> {
    seat: &'a Seat,
    poses: Vec<Pose>,
    twists: Twists,
    middle: Vec3,
    momenta: DMatrix<f64>,
    tensor: PairTensor,
    report: CouplingReport,
    /// Where the device has it.
    held: Mutex<Held>,
    /// The same on the CPU, for what isn't asked of the device.
    alone: OnceLock<Box<dyn Linearised + 'a>>,
}

impl<'a> SolvedTogether<'a> {
    pub fn new(
        seat: &'a Seat,
        poses: &[Pose],
        basis: &DMatrix<f64>,
        held: Held,
        found: Found,
    ) -> Self {
        let model = &seat.group.model;
        let twists = Twists::new(basis.clone(), model.length);
        let (bodies, columns) = (model.sizes.bodies, model.sizes.columns);
        let pairs = columns * (columns + 1) / 2;
        let of = |b: usize| {
            let mut wrenches = DMatrix::zeros(6, columns * columns);
            for x in 0..columns {
                for y in 0..=x {
                    let at = 6 * (b * pairs + x * (x + 1) / 2 + y);
                    let unit = FLUX * twists.scale[x] * twists.scale[y];
                    let values = &found.wrenches[at..at + 6];
                    let w = spatial(model.length, &found.middle, values, unit);
                    wrenches.set_column(x * columns + y, &w);
                    wrenches.set_column(y * columns + x, &w);
                }
            }
            wrenches
        };
        Self {
            seat,
            poses: poses.to_vec(),
            tensor: PairTensor::new(columns, (0..bodies).map(of).collect()),
            twists,
            middle: found.middle,
            momenta: found.momenta,
            report: found.report,
            held: Mutex::new(held),
            alone: OnceLock::new(),
        }
    }

    /// The CPU's, made when first asked for.
    fn alone(&self) -> Result<&dyn Linearised> {
        if let Some(found) = self.alone.get() {
            return Ok(found.as_ref());
        }
        self.seat.group.count_alone();
        let reduced = &self.seat.group.model.reduced;
        let made = reduced.linearise(&self.poses, &self.twists.all)?;
        Ok(self.alone.get_or_init(|| made).as_ref())
    }

    /// The slot that holds this evaluation; it is put there again where others were since.
    fn slot(&self) -> Result<u32> {
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        if !self.seat.holds(*held) {
            *held = self.seat.put(Kind::Value, &self.poses, &self.twists)?.0;
        }
        Ok(self.seat.place(*held))
    }

    /// Asks about this evaluation: the numbers of each answer.
    fn ask(&self, kind: Kind, inputs: &[(Vec<f64>, Vec<f64>)]) -> Result<Vec<[Vec<f64>; 2]>> {
        let slot = self.slot()?;
        let seat = self.seat;
        let question = |(input, direction): &(Vec<f64>, Vec<f64>)| Question {
            kind,
            slot,
            input: seat.bytes(input),
            direction: seat.bytes(direction),
        };
        let questions = inputs.iter().map(question).collect();
        let answers = seat.group.ask(seat.number, questions)?;
        let numbers = |answer: &Answer| answer.numbers(&seat.group.model);
        Ok(answers.iter().map(numbers).collect())
    }

    /// Coefficients on the basis in the device's units, and what they are in units of.
    fn coefficients(&self, x: &DVector<f64>) -> (Vec<f64>, f64) {
        let (along, units) =
            self.twists
                .combined(&DMatrix::from_column_slice(x.len(), 1, x.as_slice()));
        (units.as_slice().to_vec(), along.scale[0])
    }

    /// Some columns' momenta, and their wrenches with a combination of the basis; `None` where the device doesn't solve them.
    fn respond_with(&self, twists: &DMatrix<f64>, x: &DVector<f64>) -> Result<Option<Responses>> {
        let model = &self.seat.group.model;
        let twists = Twists::new(twists.clone(), model.length);
        let (n, bodies) = (twists.all.ncols(), model.sizes.bodies);
        let (direction, along) = self.coefficients(x);
        let found = self.ask(Kind::Respond(n), &[(twists.numbers(), direction)])?;
        let Some([solved, wrenches]) = found.first() else {
            return Ok(None);
        };
        let (values, status) = solved.split_at(6 * bodies * n);
        if !is_solved(status) {
            return Ok(None);
        }
        let momenta = impulses(model.reduced.reduced_bodies(), &twists, values);
        let of = |b: usize, k: usize| {
            let at = 6 * (b * n + k);
            let unit = FLUX * twists.scale[k] * along;
            spatial(model.length, &self.middle, &wrenches[at..at + 6], unit)
        };
        let wrenches = (0..n).map(|k| (0..bodies).map(|b| of(b, k)).collect());
        Ok(Some((momenta, wrenches.collect())))
    }

    /// Tangents of one combination or two along displacements; `None` where the device doesn't solve them.
    fn tangents(
        &self,
        directions: &[&DVector<f64>],
        z: &[Vec<Vec6>],
    ) -> Result<Option<Vec<Tangent>>> {
        let model = &self.seat.group.model;
        let (n, bodies, length) = (directions.len(), model.sizes.bodies, model.length);
        let all = DMatrix::from_fn(self.twists.all.ncols(), n, |k, c| directions[c][k]);
        let (along, units) = self.twists.combined(&all);
        // Row by row.
        let coefficients = units.transpose().as_slice().to_vec();
        let scales: Vec<f64> = z
            .iter()
            .map(|z| {
                let all = DMatrix::from_fn(6 * z.len(), 1, |i, _| z[i / 6][i % 6]);
                size(&all, 0, length)
            })
            .collect();
        let input = |(z, scale): (&Vec<Vec6>, &f64)| {
            let images = model.images.iter();
            let seen = images.flat_map(|image| z.iter().map(|z| image.twist(&(z / *scale))));
            let mut values = coefficients.clone();
            values.extend(motions(seen, &self.middle, length));
            (values, Vec::new())
        };
        let inputs: Vec<_> = z.iter().zip(&scales).map(input).collect();
        let found = self.ask(Kind::Tangent(n), &inputs)?;
        let mut out = Vec::with_capacity(z.len());
        for ([solved, _], scale) in found.iter().zip(&scales) {
            let (values, rest) = solved.split_at(6 * bodies * n);
            let (wrenches, status) = rest.split_at(12 * bodies);
            if !is_solved(&status[..STATUS]) {
                return Ok(None);
            }
            let momenta = along.impulses(values, FLUX * scale);
            let unit = FLUX * along.scale[0] * along.scale[n - 1];
            let of = |b: usize, part: usize, unit: f64| {
                let at = 12 * b + 6 * part;
                spatial(length, &self.middle, &wrenches[at..at + 6], unit)
            };
            out.push(Tangent {
                momentum_x: momenta.column(0).into_owned(),
                momentum_y: momenta.column(n - 1).into_owned(),
                gradient: (0..bodies).map(|b| of(b, 0, unit)).collect(),
                wrench: (0..bodies).map(|b| of(b, 1, unit * scale)).collect(),
            });
        }
        Ok((out.len() == z.len()).then_some(out))
    }
}

impl Linearised for SolvedTogether<'_> {
    fn momenta(&self) -> &DMatrix<f64> {
        &self.momenta
    }

    fn gradient(&self, x: &DVector<f64>, y: &DVector<f64>) -> Result<Vec<Vec6>> {
        Ok(self.tensor.contract(x, y))
    }

    fn gradient_along(&self, y: &DVector<f64>, z: &[Vec6]) -> Result<DVector<f64>> {
        Ok(self.tensor.along(y, z))
    }

    fn vjp(&self, x: Direction, y: Direction) -> Result<Pullback> {
        let (twist, basis) = match (x, y) {
            (Direction::Basis(x), Direction::Basis(y)) => {
                return Ok(Pullback {
                    momentum_x: &self.momenta * x,
                    momentum_y: &self.momenta * y,
                    wrench: self.tensor.contract(x, y),
                });
            }
            (Direction::Twist(t), Direction::Basis(b))
            | (Direction::Basis(b), Direction::Twist(t)) => (t, b),
            (Direction::Twist(_), Direction::Twist(_)) => return self.alone()?.vjp(x, y),
        };
        let column = DMatrix::from_column_slice(twist.len(), 1, twist.as_slice());
        let Some((momenta, mut wrenches)) = self.respond_with(&column, basis)? else {
            return self.alone()?.vjp(x, y);
        };
        let (own, other) = (momenta.column(0).into_owned(), &self.momenta * basis);
        let [momentum_x, momentum_y] = match x {
            Direction::Twist(_) => [own, other],
            Direction::Basis(_) => [other, own],
        };
        Ok(Pullback {
            momentum_x,
            momentum_y,
            wrench: wrenches.swap_remove(0),
        })
    }

    fn respond(
        &self,
        twists: &DMatrix<f64>,
        x: &DVector<f64>,
    ) -> Result<(DMatrix<f64>, Vec<Vec<Vec6>>)> {
        let bodies = self.seat.group.model.sizes.bodies;
        if twists.iter().all(|x| *x == 0.0) {
            let still = vec![vec![Vec6::zeros(); bodies]; twists.ncols()];
            return Ok((twists.clone(), still));
        }
        let mut momenta = DMatrix::zeros(twists.nrows(), twists.ncols());
        let mut wrenches = Vec::with_capacity(twists.ncols());
        for (first, count) in passes(twists.ncols(), self.seat.group.model.sizes.columns) {
            let part = twists.columns(first, count).into_owned();
            let Some((own, pairs)) = self.respond_with(&part, x)? else {
                return self.alone()?.respond(twists, x);
            };
            momenta.columns_mut(first, count).copy_from(&own);
            wrenches.extend(pairs);
        }
        Ok((momenta, wrenches))
    }

    fn displaced(&self, x: &DVector<f64>, z: &[Vec<Vec6>]) -> Result<Vec<Tangent>> {
        match self.tangents(&[x], z)? {
            Some(found) => Ok(found),
            None => self.alone()?.displaced(x, z),
        }
    }

    fn hvp(&self, x: Direction, y: Direction, z: &[Vec6]) -> Result<Tangent> {
        let (Direction::Basis(a), Direction::Basis(b)) = (x, y) else {
            return self.alone()?.hvp(x, y, z);
        };
        let both = [a, b];
        let directions = &both[..if a == b { 1 } else { 2 }];
        let found = self.tangents(directions, &[z.to_vec()])?;
        match found.and_then(|mut found| found.pop()) {
            Some(tangent) => Ok(tangent),
            None => self.alone()?.hvp(x, y, z),
        }
    }

    fn report(&self) -> &CouplingReport {
        &self.report
    }
}
