//! Gaps that the points don't resolve: what their films add to the exchange, and what it changes that they hold bodies apart.
//!
//! Ĝ sees each pair of bodies as it is. Of those that a film holds apart it is corrected by what they see of each other at the greater distance less what they do as they are, point by point, so that
//! the energy is that of the factor's ([`Reduced`](crate::coupling::reduced)); and the film's own is one matrix of both bodies' twists.

use super::Scattering;
use super::elsewhere::Changed;
use super::parts::of_each;
use crate::Result;
use crate::adjoint::lie::{Pose, Vec6};
use crate::coupling::film::{MovingFilms, PlacedFilms, Side};
use crate::coupling::reduced::{Charge, FLUX, Link, PlacedSkeletons};
use crate::geometry::Image;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// All narrow gaps at some poses.
pub(super) struct Narrow<'a> {
    model: &'a Scattering,
    poses: Vec<Pose>,
    films: PlacedFilms,
    /// Films hold nobody apart here.
    none: PlacedFilms,
    gaps: Vec<Gap>,
}

/// A narrow gap: between bodies, or a body and its own image.
struct Gap {
    link: Link,
    /// What modes and twists see of each other beyond what Ĝ says: (modes + 6) × (modes + 6).
    seen: DMatrix<f64>,
    /// Impulses of the film to the twists of both bodies, or of the one, body frames.
    film: DMatrix<f64>,
}

/// The same as bodies are displaced.
pub(super) struct MovingNarrow<'n> {
    narrow: &'n Narrow<'n>,
    z: Vec<Vec6>,
    films: MovingFilms<'n>,
    still: MovingFilms<'n>,
}

impl Scattering {
    /// The gaps at these poses that have films.
    ///
    /// # Errors
    /// Bodies that touch.
    pub(super) fn narrow(&self, poses: &[Pose]) -> Result<Narrow<'_>> {
        let basis = DMatrix::zeros(6 * self.bodies.len(), 0);
        let films = self.films.place(poses, &basis, &self.names)?;
        let mut out = Narrow {
            model: self,
            poses: poses.to_vec(),
            none: PlacedFilms::default(),
            gaps: Vec::new(),
            films,
        };
        let films: Vec<_> = out.films.iter().collect();
        let gaps = films.par_iter().map(|film| {
            let (own, other) = film.sides();
            let link = match other {
                Side::Body(b) => Link {
                    target: own.min(b),
                    source: own.max(b),
                    image: Image::identity(),
                    cutoff: None,
                    factor: 1.0,
                },
                // Its own image, of which half counts.
                Side::Wall(image) => Link {
                    target: own,
                    source: own,
                    image,
                    cutoff: None,
                    factor: 0.5 * image.sign,
                },
            };
            let block = |films| {
                let placed = link.place(&self.bodies, poses, films);
                placed.map(|placed| placed.block(&self.bodies))
            };
            let seen = match (block(&out.films), block(&out.none)) {
                (Some(apart), Some(near)) => {
                    let (rows, columns) = (apart.nrows(), apart.ncols());
                    DMatrix::from_fn(rows, columns, |i, j| {
                        link.factor * (apart[(i, j)] - near[(i, j)])
                    })
                }
                // Without a cutoff no link fades.
                _ => DMatrix::zeros(0, 0),
            };
            let film = film.impulses_of_each(&[link.target, link.source]);
            Gap { link, seen, film }
        });
        out.gaps = gaps.collect();
        Ok(out)
    }
}

impl Gap {
    /// The bodies, one or two.
    fn bodies(&self) -> impl Iterator<Item = usize> + use<> {
        let both = [self.link.target, self.link.source];
        both.into_iter().take(self.film.ncols() / 6)
    }
}

impl<'a> Narrow<'a> {
    /// What holds bodies apart.
    pub fn films(&self) -> &PlacedFilms {
        &self.films
    }

    /// Whether there is any.
    pub fn any(&self) -> bool {
        !self.gaps.is_empty()
    }

    /// The bodies of each film and its impulses to their twists, body frames.
    pub fn masses(&self) -> impl Iterator<Item = (Vec<usize>, &DMatrix<f64>)> {
        self.gaps
            .iter()
            .map(|gap| (gap.bodies().collect(), &gap.film))
    }

    /// Adds to what modes and twists see of each other's charges, of the twists as impulses, films' own left out.
    pub fn add_exchanged(
        &self,
        twists: &DVector<f64>,
        modes: &[f64],
        (seen, impulses): (&mut [f64], &mut DVector<f64>),
    ) {
        let modes_of = |b: usize| self.model.modes[b].clone();
        let numbers = |b: usize| {
            let (own, twist) = (&modes[modes_of(b)], twists.rows(6 * b, 6));
            let all = own.iter().chain(twist.iter()).copied();
            DVector::from_iterator(own.len() + 6, all)
        };
        let of_gap = |k: usize| {
            let Gap { link, seen, .. } = &self.gaps[k];
            [
                seen * numbers(link.source),
                seen.tr_mul(&numbers(link.target)),
            ]
        };
        let found = of_each(self.gaps.len(), of_gap);
        for (gap, found) in self.gaps.iter().zip(&found) {
            for (b, x) in [gap.link.target, gap.link.source].into_iter().zip(found) {
                let (of_modes, of_twists) = x.as_slice().split_at(modes_of(b).len());
                let own = seen[modes_of(b)].iter_mut();
                own.zip(of_modes).for_each(|(o, x)| *o += x);
                let rows = impulses.as_mut_slice()[6 * b..6 * b + 6].iter_mut();
                rows.zip(of_twists).for_each(|(o, x)| *o += FLUX * x);
            }
        }
    }

    /// Adds the impulses of twists that films have themselves.
    pub fn add_impulses(&self, twists: &DVector<f64>, out: &mut DVector<f64>) {
        for gap in &self.gaps {
            self.add_film_of(gap, twists, out);
        }
    }

    fn add_film_of(&self, gap: &Gap, twists: &DVector<f64>, out: &mut DVector<f64>) {
        let mut own = DVector::zeros(gap.film.ncols());
        for (k, b) in gap.bodies().enumerate() {
            own.rows_mut(6 * k, 6).copy_from(&twists.rows(6 * b, 6));
        }
        let found = &gap.film * own;
        for (k, b) in gap.bodies().enumerate() {
            let mut rows = out.rows_mut(6 * b, 6);
            rows += found.rows(6 * k, 6);
        }
    }

    /// What both forms of each gap give: as films hold it apart, with the sign 1, and, to be taken off, as it is, with −1.
    fn forms<T: Send>(
        &self,
        of: impl Fn(&PlacedSkeletons, f64) -> T + Sync,
    ) -> Vec<(PlacedSkeletons<'_>, f64, T)> {
        let both = |gap| [1.0, -1.0].map(|sign| (gap, sign));
        let forms: Vec<(&Gap, f64)> = self.gaps.iter().flat_map(both).collect();
        let forms = forms.into_par_iter().filter_map(|(gap, sign)| {
            let films = self.holding(sign);
            let placed = (gap.link).place(&self.model.bodies, &self.poses, films)?;
            let found = of(&placed, sign);
            Some((placed, sign, found))
        });
        forms.collect()
    }

    /// Adds 4π αᵀ δĜ α of charges with themselves as spatial wrenches.
    pub fn add_gradient(&self, charges: &[f64], out: &mut [Vec6]) {
        let of = |placed: &PlacedSkeletons, _: f64| {
            let [t, s] = self.ends(placed, charges);
            placed.pull_back(&self.model.bodies, [t, t], [s, s])
        };
        for (placed, sign, (wrench, force)) in self.forms(of) {
            let told = (&(sign * wrench), &(sign * force));
            placed.apply(&self.poses, self.holding(sign), told, out);
        }
    }

    /// Adds ∇E of what films have themselves, of body-frame twists.
    pub fn add_wrenches(&self, x: &DVector<f64>, y: &DVector<f64>, out: &mut [Vec6]) {
        self.films.add_wrenches(x, y, out);
    }

    /// As the bodies are displaced by spatial twists.
    pub fn along(&self, z: &[Vec6]) -> MovingNarrow<'_> {
        MovingNarrow {
            narrow: self,
            films: self.films.along(z),
            still: self.none.along(z),
            z: z.to_vec(),
        }
    }

    /// What holds a form of a gap apart.
    fn holding(&self, sign: f64) -> &PlacedFilms {
        if sign > 0.0 { &self.films } else { &self.none }
    }

    /// Of charges those at the target and at the source.
    fn ends<'c>(&self, placed: &PlacedSkeletons, charges: &'c [f64]) -> [&'c [f64]; 2] {
        [placed.link.target, placed.link.source].map(|b| &charges[self.model.points[b].clone()])
    }
}

impl<'n> MovingNarrow<'n> {
    /// What holds bodies apart.
    pub fn films(&self) -> &MovingFilms<'n> {
        &self.films
    }

    fn holding(&self, sign: f64) -> &MovingFilms<'_> {
        if sign > 0.0 { &self.films } else { &self.still }
    }

    /// Adds `DĜ[Z] α`.
    pub fn add_tangent_potentials(&self, charges: &[f64], out: &mut [f64]) {
        let narrow = self.narrow;
        let of = |placed: &PlacedSkeletons, sign: f64| {
            let moved = placed.moved(&narrow.poses, &self.z, self.holding(sign));
            let [t, s] = narrow.ends(placed, charges);
            placed.tangent_potentials(&narrow.model.bodies, &moved, &[t], &[s])
        };
        for (placed, sign, found) in narrow.forms(of) {
            self.add_at_ends(&placed, sign, [&found.on_target, &found.on_source], out);
        }
    }

    /// Adds how what charges see changes, 4π αᵀ δĜ α, and how that changes, as the charges do at these rates.
    pub fn add_changed(&self, charges: &[f64], rates: &[f64], out: &mut Changed) {
        let narrow = self.narrow;
        let bodies = &narrow.model.bodies;
        let of = |placed: &PlacedSkeletons, sign: f64| {
            let moved = placed.moved(&narrow.poses, &self.z, self.holding(sign));
            let ([t, s], [dt, ds]) = (narrow.ends(placed, charges), narrow.ends(placed, rates));
            let seen = placed.tangent_potentials(bodies, &moved, &[t], &[s]);
            let [at_target, at_source] =
                [(t, dt), (s, ds)].map(|(value, rate)| [Charge { value, rate }]);
            let told = placed.tangent(bodies, (&moved, &seen.field), &at_target, &at_source);
            let mut on_source = placed.sums(bodies, dt, 1);
            let mut on_target = placed.potentials(bodies);
            on_target = on_target
                .chunks_exact(s.len())
                .map(|row| row.iter().zip(ds).map(|(p, x)| p * x).sum())
                .collect();
            let factor = placed.link.factor;
            let add = |out: &mut Vec<f64>, x: &[f64]| {
                out.iter_mut()
                    .zip(x)
                    .for_each(|(o, x)| *o = factor * *o + x);
            };
            add(&mut on_target, &seen.on_target);
            add(&mut on_source, &seen.on_source);
            (told, [on_target, on_source])
        };
        for (placed, sign, (([w, dw], [f, df]), [t, s])) in narrow.forms(of) {
            let ([w, dw], [f, df]) = ([w, dw].map(|w| sign * w), [f, df].map(|f| sign * f));
            let held = narrow.holding(sign);
            placed.apply(&narrow.poses, held, (&w, &f), &mut out.gradient);
            let (moving, told) = (self.holding(sign), ([&w, &dw], [&f, &df]));
            placed.apply_jvp(&narrow.poses, moving, told, &self.z, &mut out.rate);
            self.add_at_ends(&placed, sign, [&t, &s], &mut out.potentials);
        }
    }

    fn add_at_ends(&self, placed: &PlacedSkeletons, sign: f64, seen: [&[f64]; 2], out: &mut [f64]) {
        for (b, seen) in [placed.link.target, placed.link.source]
            .into_iter()
            .zip(seen)
        {
            let own = out[self.narrow.model.points[b].clone()].iter_mut();
            own.zip(seen).for_each(|(o, x)| *o += sign * x);
        }
    }

    /// Adds the rate of the impulses that films have themselves, of body-frame twists that stay as they are.
    pub fn add_impulse_rate(&self, twists: &DVector<f64>, out: &mut DVector<f64>) {
        self.films.add_impulse_rate(twists, out);
    }

    /// Adds ∇E of what films have themselves, of the first of one or two twists with the last, its rate, and the rates of the impulses of each.
    pub fn add_tangent(
        &self,
        twists: &[&DVector<f64>],
        wrenches: (&mut [Vec6], &mut [Vec6]),
        impulses: &mut [DVector<f64>],
    ) {
        if self.narrow.any() {
            self.films.add_tangent(twists, &self.z, wrenches, impulses);
        }
    }
}
