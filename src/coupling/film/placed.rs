//! A film at given poses: the added mass that it has beyond one that is held apart, with derivatives.

use super::flow::{Flow, System};
use super::jet::{Displaced, Screw, constant, rates};
use super::layer::{Layer, Near};
use super::pull::Reverse;
use super::{Film, Side};
use crate::adjoint::lie::{Pose, Vec3, Vec6, cross_force};
use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;
use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

/// Columns up to which all pairs of them cost no more than a few derivatives one by one.
const FEW: usize = 6;

/// A film whose gap is below what others resolve.
pub(crate) struct PlacedFilm {
    pub film: Arc<Film>,
    /// Pose of the first body in the frame of the other, or in that of the world.
    pub(super) relative: Pose,
    /// Frame of what is opposite, to world.
    frame: Pose,
    /// How far others are to hold the two apart, in the frame of each.
    pub shift: [Vec3; 2],
    near: Near,
    pub(super) layer: Layer<f64>,
    system: System,
    /// Columns of the basis that move it, with the numbers of their potentials, which equal ones share.
    columns: Vec<(usize, usize)>,
    solved: Vec<Solved>,
    /// Of every two of these. Made when first asked for.
    wrenches: OnceLock<Vec<Vec6>>,
    /// Made when first asked for.
    reverse: OnceLock<Reverse<f64>>,
}

/// Why there is no film where there should be one.
#[derive(Clone, Copy, Debug)]
pub(crate) enum NoFilm {
    /// A distance that isn't positive, m.
    Touching(f64),
    /// The two can't be held apart: the gap, and the least distance at which they then would be, m.
    Squeezed { gap: f64, held: f64 },
}

/// The potential of twists of both sides, frame of the first, as the film is and held apart.
struct Solved {
    twists: [Vec6; 2],
    /// Of the other side, in its own frame.
    other: Vec6,
    potential: Vec<[f64; 2]>,
}

/// The flow in a film along a displacement.
pub(crate) struct MovingFlow(pub(super) Flow<Dual64>);

/// A film along a displacement.
pub(crate) struct MovingFilm<'a> {
    pub placed: &'a PlacedFilm,
    frame: Displaced<'a, Dual64>,
    layer: Layer<Dual64>,
    reverse: OnceLock<Reverse<Dual64>>,
}

impl PlacedFilm {
    /// For a basis of body-frame twists. None where the gap is wide.
    pub fn new(
        film: &Arc<Film>,
        poses: &[Pose],
        basis: &DMatrix<f64>,
    ) -> Result<Option<Self>, NoFilm> {
        let frame = match film.other {
            Side::Body(b) => poses[b],
            Side::Wall(_) => Pose::identity(),
        };
        let relative = frame.inverse().compose(&poses[film.body]);
        let still = Displaced::new(&relative, &Vec6::zeros());
        let Some(near) = film.near(&still).map_err(NoFilm::Touching)? else {
            return Ok(None);
        };
        let Some(layer) = Layer::new(film, &still, &near, None) else {
            return Ok(None);
        };
        let (gap, held) = (layer.gap.value, layer.least_held());
        let system = film.system(&layer).filter(|_| held > 0.0);
        let system = system.ok_or(NoFilm::Squeezed { gap, held })?;
        let mut out = Self {
            film: film.clone(),
            relative,
            frame,
            shift: layer.shift.map(Vec3::from),
            near,
            layer,
            system,
            columns: Vec::new(),
            solved: Vec::new(),
            wrenches: OnceLock::new(),
            reverse: OnceLock::new(),
        };
        for (c, column) in basis.column_iter().enumerate() {
            let x = out.twists(&column.into_owned());
            if x.moves() {
                let twists = out.both(&x);
                let known = out.solved.iter().position(|known| known.twists == twists);
                out.columns.push((c, known.unwrap_or(out.solved.len())));
                if known.is_none() {
                    let solved = out.solve(&x);
                    out.solved.push(solved);
                }
            }
        }
        Ok(Some(out))
    }

    fn still(&self) -> Displaced<'_, f64> {
        Displaced::new(&self.relative, &Vec6::zeros())
    }

    fn in_reverse(&self) -> &Reverse<f64> {
        (self.reverse).get_or_init(|| self.layer.reverse(&self.film, &self.still()))
    }

    pub(super) fn twists(&self, x: &DVector<f64>) -> Twists {
        let of = |b: usize| x.fixed_rows::<6>(6 * b).into_owned();
        Twists {
            own: of(self.film.body),
            other: match self.film.other {
                Side::Body(b) => of(b),
                Side::Wall(_) => Vec6::zeros(),
            },
        }
    }

    /// In the frame of the first.
    fn both(&self, x: &Twists) -> [Vec6; 2] {
        [x.own, self.relative.twist_to_body(&x.other)]
    }

    fn solve(&self, x: &Twists) -> Solved {
        let twists = self.both(x);
        Solved {
            potential: self.system.potential(&twists),
            other: x.other,
            twists,
        }
    }

    /// The potential of a column's twists, if it was solved for, or else anew.
    pub(super) fn potential(&self, x: &Twists) -> Cow<'_, [[f64; 2]]> {
        let twists = self.both(x);
        let known = self.solved.iter().find(|known| known.twists == twists);
        match known {
            Some(known) => Cow::Borrowed(&known.potential),
            None => Cow::Owned(self.system.potential(&twists)),
        }
    }

    /// Adds the impulses of the twists in the columns, body frames.
    pub fn add_impulses(&self, twists: &DMatrix<f64>, out: &mut DMatrix<f64>) {
        for (c, column) in twists.column_iter().enumerate() {
            let x = self.twists(&column.into_owned());
            if !x.moves() {
                continue;
            }
            let potential = self.potential(&x);
            let apart = potential.iter().map(|psi| psi[0] - psi[1]);
            let [impulse, back] = self.system.impulses(apart);
            let mut add = |b: usize, wrench: &Vec6| {
                let mut rows = out.fixed_view_mut::<6, 1>(6 * b, c);
                rows += wrench;
            };
            add(self.film.body, &impulse);
            if let Side::Body(b) = self.film.other {
                add(b, &self.relative.wrench_to_world(&back));
            }
        }
    }

    /// The body on whose faces it is solved, and what is opposite.
    pub fn sides(&self) -> (usize, Side) {
        (self.film.body, self.film.other)
    }

    /// The impulses of a unit of each twist of these bodies, of which it has one or two, in their order: body frames.
    pub fn impulses_of_each(&self, bodies: &[usize; 2]) -> DMatrix<f64> {
        let own = |b: usize| b == self.film.body;
        let count = match self.film.other {
            Side::Body(_) => 12,
            Side::Wall(_) => 6,
        };
        let mut out = DMatrix::zeros(count, count);
        for k in 0..count {
            let unit = Vec6::ith(k % 6, 1.0);
            let x = match own(bodies[k / 6]) {
                true => [unit, Vec6::zeros()],
                false => [Vec6::zeros(), self.relative.twist_to_body(&unit)],
            };
            let potential = self.system.potential(&x);
            let apart = potential.iter().map(|psi| psi[0] - psi[1]);
            let [impulse, back] = self.system.impulses(apart);
            for (b, rows) in bodies
                .iter()
                .zip(out.column_mut(k).as_mut_slice().chunks_exact_mut(6))
            {
                let told = match own(*b) {
                    true => impulse,
                    false => self.relative.wrench_to_world(&back),
                };
                rows.copy_from_slice(told.as_slice());
            }
        }
        out
    }

    /// The film along spatial displacements of the bodies.
    pub fn along(&self, z: &[Vec6]) -> Option<MovingFilm<'_>> {
        let relative = match self.film.other {
            Side::Body(b) => z[self.film.body] - z[b],
            Side::Wall(_) => z[self.film.body],
        };
        let frame = Displaced::new(&self.relative, &self.frame.twist_to_body(&relative));
        let layer = Layer::new(&self.film, &frame, &self.near, Some(&self.layer))?;
        Some(MovingFilm {
            placed: self,
            frame,
            layer,
            reverse: OnceLock::new(),
        })
    }

    /// The wrench, frame of the other, that a force in the frame `at` (0: of the first) exerts by way of the shift.
    pub fn shift_wrench(&self, at: usize, force: &Vec3) -> Vec6 {
        Vec6::from(self.in_reverse().pull_shift(at, &constant(force)))
    }

    fn flow(&self, x: &DVector<f64>) -> Flow<f64> {
        let x = self.twists(x);
        let solved = (&self.system, &self.potential(&x)[..]);
        (self.film).flow((&self.layer, &self.still()), solved, [&x.own, &x.other])
    }

    /// ∇E(x, y), frame of the other.
    pub fn wrench(&self, x: &DVector<f64>, y: &DVector<f64>) -> Vec6 {
        if [x, y].iter().any(|x| !self.twists(x).moves()) {
            return Vec6::zeros();
        }
        let (own, how) = (self.flow(x), (&self.layer, self.in_reverse()));
        let other = (x != y).then(|| self.flow(y));
        let pair = (&own, other.as_ref().unwrap_or(&own));
        Vec6::from((self.film).wrench(how, &self.still(), pair.0, pair.1))
    }

    /// ∇E(x, y) of combinations of the basis, frame of the other: from that of every two columns where few move it, which steps ask for anyway.
    pub fn basis_wrench(&self, basis: &DMatrix<f64>, [x, y]: [&DVector<f64>; 2]) -> Vec6 {
        if self.solved.len() > FEW {
            return self.wrench(&(basis * x), &(basis * y));
        }
        let of_x = self.pulled(x);
        self.parts(y).iter().zip(of_x).map(|(y, x)| *y * x).sum()
    }

    /// ∇E(x, e) of a combination x of the basis and every column e of it that moves, frame of the other.
    pub fn column_wrenches(&self, x: &DVector<f64>) -> Vec<(usize, Vec6)> {
        let all = self.pulled(x);
        let columns = self.columns.iter();
        columns.map(|(c, number)| (*c, all[*number])).collect()
    }

    /// Faces that it has.
    pub fn faces(&self) -> usize {
        self.layer.cells.len()
    }

    /// Those to be gone through for the wrenches of columns of the basis: none where these are known.
    pub fn faces_left(&self) -> usize {
        match self.wrenches.get() {
            Some(_) if self.solved.len() <= FEW => 0,
            _ => self.faces(),
        }
    }

    /// How much of each potential there is in a combination of the basis.
    fn parts(&self, x: &DVector<f64>) -> Vec<f64> {
        let mut out = vec![0.0; self.solved.len()];
        for (column, number) in &self.columns {
            out[*number] += x[*column];
        }
        out
    }

    /// ∇E(x, e) of every e that was solved for.
    fn pulled(&self, x: &DVector<f64>) -> Vec<Vec6> {
        let all = self.wrenches.get_or_init(|| {
            let rates = self.in_reverse().rates(&self.film, &self.layer);
            let (still, layer) = (self.still(), &self.layer);
            let flow = |s: &Solved| {
                let solved = (&self.system, &s.potential[..]);
                (self.film).flow((layer, &still), solved, [&s.twists[0], &s.other])
            };
            let flows: Vec<_> = self.solved.iter().map(flow).collect();
            self.film.wrenches((layer, &rates), &still, &flows)
        });
        let parts = self.parts(x);
        let of = |number: usize| -> Vec6 {
            let pair = |other: usize| {
                let (low, high) = (number.min(other), number.max(other));
                all[high * (high + 1) / 2 + low]
            };
            let parts = parts.iter().enumerate();
            parts.map(|(other, part)| *part * pair(other)).sum()
        };
        (0..parts.len()).map(of).collect()
    }

    /// Adds a wrench in the frame of the other to both bodies, as spatial wrenches.
    pub fn apply(&self, wrench: &Vec6, out: &mut [Vec6]) {
        self.apply_world(&self.frame.wrench_to_world(wrench), out);
    }

    fn apply_world(&self, world: &Vec6, out: &mut [Vec6]) {
        for (body, wrench) in self.on_both(world) {
            out[body] += wrench;
        }
    }

    /// The spatial wrenches that one in the frame of the other is on each body.
    pub fn spread(&self, wrench: &Vec6) -> impl Iterator<Item = (usize, Vec6)> {
        self.on_both(&self.frame.wrench_to_world(wrench))
    }

    fn on_both(&self, world: &Vec6) -> impl Iterator<Item = (usize, Vec6)> + use<> {
        let other = match self.film.other {
            Side::Body(b) => Some((b, -world)),
            Side::Wall(_) => None,
        };
        std::iter::once((self.film.body, *world)).chain(other)
    }
}

impl MovingFilm<'_> {
    fn in_reverse(&self) -> &Reverse<Dual64> {
        (self.reverse).get_or_init(|| self.layer.reverse(&self.placed.film, &self.frame))
    }

    /// Rate of the shift in the frame `at` (0: of the first).
    pub fn shift_rate(&self, at: usize) -> Vec3 {
        Vec3::from(self.layer.shift[at].map(|x| x.eps))
    }

    /// The wrench of [`PlacedFilm::shift_wrench`] and its rate, for a force that changes.
    pub fn shift_wrench(&self, at: usize, force: &Vec3, dforce: &Vec3) -> (Vec6, Vec6) {
        let force = std::array::from_fn(|i| Dual64::new(force[i], dforce[i]));
        rates(&self.in_reverse().pull_shift(at, &force))
    }

    /// The flow for twists that stay as they are.
    pub fn flow(&self, x: &DVector<f64>) -> MovingFlow {
        let (placed, x) = (self.placed, self.placed.twists(x));
        let potential = placed.potential(&x);
        let solved = (&placed.system, &potential[..]);
        MovingFlow((placed.film).flow((&self.layer, &self.frame), solved, [&x.own, &x.other]))
    }

    /// ∇E(x, y) and its rate, frame of the other.
    pub fn wrench(&self, x: &MovingFlow, y: &MovingFlow) -> (Vec6, Vec6) {
        let film = &self.placed.film;
        rates(&film.wrench((&self.layer, self.in_reverse()), &self.frame, &x.0, &y.0))
    }

    /// Adds the rate of the impulses of a flow.
    pub fn add_impulse_rate(&self, x: &MovingFlow, out: &mut DVector<f64>) {
        let film = &self.placed.film;
        let [own, other] = x.0.impulses;
        let mut add = |b: usize, wrench: &Screw<Dual64>| {
            let mut rows = out.fixed_rows_mut::<6>(6 * b);
            rows += rates(wrench).1;
        };
        add(film.body, &own);
        if let Side::Body(b) = film.other {
            add(b, &self.frame.wrench_to_world(&other));
        }
    }

    /// Adds a wrench in the frame of the other, and its rate, to the rate of that on both bodies.
    pub fn apply_rate(&self, (wrench, rate): (&Vec6, &Vec6), z: &[Vec6], out: &mut [Vec6]) {
        let frame = &self.placed.frame;
        let turned = match self.placed.film.other {
            Side::Body(b) => cross_force(&z[b], &frame.wrench_to_world(wrench)),
            Side::Wall(_) => Vec6::zeros(),
        };
        (self.placed).apply_world(&(turned + frame.wrench_to_world(rate)), out);
    }
}

/// Body-frame twists of the two sides.
pub(super) struct Twists {
    pub own: Vec6,
    other: Vec6,
}

impl Twists {
    /// Whether one of the two sides does.
    fn moves(&self) -> bool {
        self.own != Vec6::zeros() || self.other != Vec6::zeros()
    }
}
