//! The flow's potential on the bodies' surfaces, and its rate, whatever the fidelity.
//!
//! A body that moves in the flow of others has, as Green's identity tells ([`crate::boundary::panel`]),
//!
//! ```text
//! (½ I + Ω/4π) φ = S q + ψ               ψ the potential of the others' flow at its panels' centroids
//! (½ I + Ω/4π) φ' = S q' + ψ'            ' the rate at points that go with the body
//! ```
//!
//! so that a fidelity which knows the others' flow by sources alone gives it up to the surface, by panels of the body alone. With
//! sources of strength α at y, of which nothing but relative places matters,
//!
//! ```text
//! ψ(x) = Σ α/|x − y|,   ψ' = Σ { α'/|x − y| + α ∇(1/|x − y|)·y' }       y' relative to the body
//! ```
//!
//! In a gap that a film carries y is as far off as the film holds it. What the film itself has, less what it would have held apart, comes on top as in the added
//! mass ([`FilmLoad`]).

use super::pair::Pair;
use crate::adjoint::kernel::{Points, Sources, potential_jvp, potential_sum};
use crate::adjoint::lie::{Pose, Vec3, Vec6, cross_force};
use crate::boundary::PanelBoundary;
use crate::coupling::film::{MovingFilms, PlacedFilms};
use crate::geometry::{Beneath, Image};
use crate::solver::Columns;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::Arc;

/// How all bodies in the water move at one moment.
#[derive(Clone, Copy)]
pub struct Motion<'a> {
    /// Their poses.
    pub poses: &'a [Pose],
    /// Body-frame twists through water at rest, 6·bodies: m/s, rad/s.
    pub twists: &'a DVector<f64>,
    /// The rates of these numbers, m/s² and rad/s², where rates of potentials are asked for.
    pub rates: Option<&'a DVector<f64>>,
    /// Spatial twists with which the bodies change their places.
    pub displacement: &'a [Vec6],
}

/// Potential of the flow (velocity −∇φ) on the panels of one body.
#[derive(Clone, Debug)]
pub struct SurfacePotential {
    /// φ, m²/s.
    pub value: Vec<f64>,
    /// Its rate at points that go with the body, m²/s²; not to be read where it wasn't asked for.
    pub rate: Vec<f64>,
    /// What films add to it, where there are any at the body: the rest is that of bodies held apart.
    pub film: Option<FilmLoad>,
}

/// What films have on the panels of one body, as they are less what they would have held apart: integrals over each panel.
#[derive(Clone, Debug)]
pub struct FilmLoad {
    /// Of their potential, m⁴/s.
    pub potential: Vec<f64>,
    /// Of its gradient along the surface, body frame, m³/s.
    pub gradient: Vec<Vec3>,
    /// Of their pressure at unit density, m⁴/s², where rates were asked for; beside a velocity u of bodies held apart u·`gradient` comes on top.
    pub pressure: Vec<f64>,
    /// How much of each panel lies at a film, m².
    pub area: Vec<f64>,
}

impl FilmLoad {
    fn zeros(panels: usize) -> Self {
        Self {
            potential: vec![0.0; panels],
            pressure: vec![0.0; panels],
            gradient: vec![Vec3::zeros(); panels],
            area: vec![0.0; panels],
        }
    }
}

/// Bodies that films hold apart.
#[derive(Clone, Copy)]
pub(super) struct Held<'h> {
    pub films: &'h PlacedFilms,
    /// As the bodies are displaced.
    pub moving: &'h MovingFilms<'h>,
}

impl Held<'_> {
    /// Adds what the films themselves have.
    pub fn add_water(
        &self,
        motion: &Motion,
        surfaces: &[Arc<PanelBoundary>],
        out: &mut [SurfacePotential],
    ) {
        let mut beneath: Vec<Option<Beneath>> = surfaces.iter().map(|_| None).collect();
        for film in self.moving.water(motion.twists, motion.rates) {
            for (body, own) in [(Some(film.own), true), (film.other, false)] {
                let Some(body) = body else { continue };
                let panels = surfaces[body].panels();
                let beneath = beneath[body].get_or_insert_with(|| {
                    let corners = panels.corners().iter().map(|c| c.map(|v| v as usize));
                    Beneath::new(panels.vertices(), corners)
                });
                let zeros = || FilmLoad::zeros(panels.len());
                let load = out[body].film.get_or_insert_with(zeros);
                for patch in &film.patches {
                    let face = beneath.face(if own { &patch.own } else { &patch.other });
                    load.potential[face] += patch.area * patch.potential;
                    load.pressure[face] += patch.area * patch.pressure;
                    load.area[face] += patch.area;
                    load.gradient[face] += patch.area * patch.slopes[usize::from(!own)];
                }
            }
        }
    }
}

/// What [`Coupling::surface_potentials_vjp`](super::Coupling::surface_potentials_vjp) gives: the gradient of Σ bar · potential in what a [`Motion`] has.
#[derive(Clone, Debug)]
pub struct MotionBar {
    /// Of the poses at fixed body-frame twists, their rates and spatial displacements: spatial wrenches, work on a spatial displacement of each body.
    pub poses: Vec<Vec6>,
    /// Of the body-frame twists, 6·bodies.
    pub twists: DVector<f64>,
    /// Of the rates of these numbers, 6·bodies.
    pub rates: DVector<f64>,
    /// Of the spatial twists with which the bodies change their places.
    pub displacement: Vec<Vec6>,
}

impl MotionBar {
    /// All zero.
    pub(crate) fn zeros(bodies: usize) -> Self {
        Self {
            poses: vec![Vec6::zeros(); bodies],
            twists: DVector::zeros(6 * bodies),
            rates: DVector::zeros(6 * bodies),
            displacement: vec![Vec6::zeros(); bodies],
        }
    }

    /// Adds another.
    pub(crate) fn add(&mut self, other: &Self) {
        self.twists += &other.twists;
        self.rates += &other.rates;
        let wrenches = self.poses.iter_mut().chain(&mut self.displacement);
        let more = other.poses.iter().chain(&other.displacement);
        wrenches.zip(more).for_each(|(own, more)| *own += more);
    }

    /// With the wrenches ∇_g Λ of a function Λ of the poses, and their rates as the bodies are displaced by Z = `displacement`. For another displacement Y
    /// the derivative of D_Z Λ, Z held, is rate·Y + ∇Λ·(Z × Y); that with Z is ∇Λ.
    pub(super) fn add_pull(&mut self, z: &[Vec6], gradient: &[Vec6], rate: &[Vec6]) {
        for (b, (wrench, rate)) in gradient.iter().zip(rate).enumerate() {
            self.poses[b] += rate - cross_force(&z[b], wrench);
            self.displacement[b] += wrench;
        }
    }

    /// Adds to the twists of body `b`, and to their rates.
    pub(crate) fn add_twists(&mut self, b: usize, [twist, rate]: &[Vec6; 2]) {
        let mut rows = self.twists.fixed_rows_mut::<6>(6 * b);
        rows += twist;
        let mut rows = self.rates.fixed_rows_mut::<6>(6 * b);
        rows += rate;
    }
}

impl Motion<'_> {
    /// Twists and their rates, two columns; zeros where those aren't asked for.
    pub(super) fn columns(&self) -> DMatrix<f64> {
        let still = || DVector::zeros(self.twists.len());
        let rates = self.rates.cloned().unwrap_or_else(still);
        DMatrix::from_columns(&[self.twists.clone(), rates])
    }
}

impl SurfacePotential {
    /// From both, side by side.
    pub(super) fn of(columns: &Columns) -> Self {
        Self {
            value: columns.column(0),
            rate: columns.column(1),
            film: None,
        }
    }

    /// Both side by side.
    pub(super) fn columns(&self) -> Columns {
        Columns::from_columns(&[&self.value, &self.rate])
    }
}

/// Sources of one body, body frame (m), with strengths (m³/s) and their rates, two columns.
pub(super) struct Charges<'a> {
    pub points: &'a [Vec3],
    pub strengths: Columns,
}

/// A body that sees the sources of another, or an image of them.
#[derive(Clone, Copy)]
pub(super) struct Seen {
    pub target: usize,
    pub source: usize,
    pub image: Image,
    /// What its flow counts, and the rate of that.
    pub weight: [f64; 2],
}

/// Total potentials on all surfaces, of bodies of which `seen` tells what each sees, where films hold some of them apart if any do.
pub(super) fn on_surfaces(
    motion: &Motion,
    surfaces: &[Arc<PanelBoundary>],
    charges: &[Charges],
    seen: impl Fn(usize) -> Vec<Seen> + Sync,
    held: Option<Held>,
) -> Vec<SurfacePotential> {
    let of = |(b, surface): (usize, &Arc<PanelBoundary>)| {
        let centres = &surface.faces.centres;
        let mut incident = Columns::zeros(centres.len(), 2);
        for seen in seen(b) {
            let source = &charges[seen.source];
            add(motion, centres, (&seen, source), held, &mut incident);
        }
        let twist = |x: &DVector<f64>| x.fixed_rows::<6>(6 * b).into_owned();
        let twists = [
            twist(motion.twists),
            motion.rates.map_or_else(Vec6::zeros, twist),
        ];
        SurfacePotential::of(&surface.total_potential(&twists, &incident))
    };
    let each = surfaces.par_iter().enumerate().map(of);
    let mut out: Vec<SurfacePotential> = each.collect();
    if let Some(held) = held {
        held.add_water(motion, surfaces, &mut out);
    }
    out
}

/// Adds the potential of the sources, and its rate, at points of the body that sees them.
fn add(
    motion: &Motion,
    centres: &[Vec3],
    (seen, charges): (&Seen, &Charges),
    held: Option<Held>,
    out: &mut Columns,
) {
    let place = |b: usize| (b, &motion.poses[b]);
    let (target, source) = (place(seen.target), place(seen.source));
    let mut pair = Pair::new(target, source, &seen.image, charges.points);
    let mut moved = pair.displacements(target.1, motion.displacement);
    let mut places = pair.positions.clone();
    if let Some(held) = held {
        pair = pair.held_off(held.films);
        if let Some((apart, film)) = pair.film(held.films) {
            let shift = apart.shift(film);
            places.iter_mut().for_each(|x| *x += shift);
        }
        if let Some((apart, film)) = pair.moving(held.moving) {
            let rate = apart.rate(film);
            moved.iter_mut().for_each(|x| *x += rate);
        }
    }
    let mut still = Columns::zeros(centres.len(), 2);
    // The kernel is even: what sees and what is seen may be exchanged.
    potential_sum(
        &Points::bare(&places),
        &Sources::new(centres),
        &charges.strengths.data,
        2,
        &mut still.data,
    );
    let mut moving = vec![0.0; centres.len()];
    if motion.rates.is_some() {
        let strengths = charges.strengths.column(0);
        let centres = Points::bare(centres);
        potential_jvp(&centres, &pair.points, &moved, &strengths, 1, &mut moving);
    }
    let [weight, rate] = seen.weight;
    for (i, moving) in moving.iter().enumerate() {
        let [value, change] = [still.at(i, 0), still.at(i, 1)];
        out.data[2 * i] += weight * value;
        out.data[2 * i + 1] += weight * (change + moving) + rate * value;
    }
}

/// Why there is none while films hold bodies apart.
pub(super) fn held_apart() -> Error {
    Error::Unsupported {
        what: "the flow on surfaces that a film holds apart".into(),
        why: "in a gap that the faces don't resolve the water's inertia is known, but not its pressure face by face".into(),
        instead: "use more faces there, ask before the gap closes, or take the fidelity full, or no films (`films = false`)".into(),
    }
}

/// Refuses cotangents of others than these surfaces.
pub(super) fn check_bars(surfaces: &[Arc<PanelBoundary>], bars: &[SurfacePotential]) -> Result<()> {
    let faces = |s: &[SurfacePotential]| -> Vec<[usize; 2]> {
        s.iter().map(|s| [s.value.len(), s.rate.len()]).collect()
    };
    let right: Vec<[usize; 2]> = surfaces.iter().map(|s| [s.faces.len(); 2]).collect();
    let given = faces(bars);
    (given == right).then_some(()).ok_or_else(|| {
        Error::input(
            "flow on surfaces: cotangents of values and rates",
            format!("{given:?} numbers"),
            format!("must be as many as the bodies have faces: {right:?}"),
        )
    })
}

/// Refuses surfaces that aren't the bodies'.
pub(super) fn check(motion: &Motion, surfaces: &[Arc<PanelBoundary>]) -> Result<()> {
    let (bodies, rows) = (motion.poses.len(), 6 * motion.poses.len());
    let fits = surfaces.len() == bodies
        && motion.displacement.len() == bodies
        && motion.twists.len() == rows
        && motion.rates.is_none_or(|rates| rates.len() == rows);
    fits.then_some(()).ok_or_else(|| {
        Error::input(
            "flow on surfaces: surfaces and motions",
            format!(
                "{} surfaces, {} displacements, {} and {:?} numbers of twists and rates",
                surfaces.len(),
                motion.displacement.len(),
                motion.twists.len(),
                motion.rates.map(|rates| rates.len())
            ),
            format!("one of each, and six numbers, for each of the {bodies} bodies"),
        )
    })
}
