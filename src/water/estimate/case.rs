//! The water of a scene at its start, and the same on other meshes.

use crate::Result;
use crate::adjoint::lie::Pose;
use crate::coupling::{Coupling, CouplingReport};
use crate::geometry::Gaps;
use crate::multibody::Tree;
use crate::scene::{Scene, WallSurface};
use crate::water::choices::{WaterChoices, surfaces};
use crate::water::device::Device;
use crate::water::fidelity::{Fidelity, compressed_all, responses};
use crate::water::method::Method;
use crate::water::method::kind::Problem;
use crate::water::numerics::Numerics;
use crate::water::prepared::{Prepared, world_axes};
use crate::water::resolved::narrowest;
use crate::water::submerged::{SubmergedBody, in_water};
use crate::water::surface::{Meshing, Surface, surface};
use nalgebra::DMatrix;

/// A direction that hardly moves water (a round body's spin) counts as this part of the water
/// displaced.
const LEAST: f64 = 0.01;
/// Faces a body on which the coupling that `Isolated` leaves out is computed.
const COUPLING_FACES: usize = 320;

/// What a film's part of the added mass may be off, relative: most where it goes round a curved body, as it does for motions along the gap.
const FILM: f64 = 0.2;
/// Most that a gap which isn't resolved may weigh.
const NARROWEST: f64 = 10.0;

/// What an estimate is asked for.
#[derive(Clone, Copy)]
pub(crate) struct Subject<'a> {
    pub scene: &'a Scene,
    pub choices: &'a WaterChoices,
    pub tree: &'a Tree,
    /// Poses of all bodies of the scene.
    pub poses: &'a [Pose],
    pub water: &'a Prepared,
    /// Names of the shape parameters.
    pub shape_parameters: &'a [String],
}

/// What the estimate is of.
pub(crate) struct Case<'a> {
    pub subject: Subject<'a>,
    pub fidelity: Fidelity,
    /// The bodies of the matrix, by their numbers in the scene.
    bodies: &'a [usize],
    poses: Vec<Pose>,
    turn: DMatrix<f64>,
    /// Unit density, world axes.
    matrix: DMatrix<f64>,
    diagonal: Vec<f64>,
    /// Of all bodies of the scene.
    pub surfaces: Vec<Option<Surface>>,
    /// What compressed bodies are off from their own methods' answers.
    correction: Option<DMatrix<f64>>,
    /// What films in narrow gaps add to the matrix, where there may be any.
    films: Option<DMatrix<f64>>,
    pub report: CouplingReport,
}

fn symmetric(m: &DMatrix<f64>) -> DMatrix<f64> {
    0.5 * (m + m.transpose())
}

/// M̄ along world axes.
fn evaluate(
    coupling: &dyn Coupling,
    poses: &[Pose],
    turn: &DMatrix<f64>,
) -> Result<(DMatrix<f64>, CouplingReport)> {
    let record = coupling.evaluate(poses, turn)?;
    let m = symmetric(&turn.tr_mul(record.momenta()));
    Ok((m, record.report().clone()))
}

impl<'a> Case<'a> {
    pub fn new(subject: Subject<'a>) -> Result<Self> {
        let Subject {
            scene,
            choices,
            water,
            shape_parameters,
            ..
        } = subject;
        let bodies = water.bodies.as_slice();
        let poses: Vec<Pose> = bodies.iter().map(|b| subject.poses[*b]).collect();
        let surfaces = surfaces(scene, choices, shape_parameters)?;
        let turn = world_axes(&poses);
        let (matrix, report) = evaluate(water.coupling.as_ref(), &poses, &turn)?;
        let films = water.coupling.film_momenta(&poses, &turn)?;
        let diagonal = (0..matrix.nrows())
            .map(|i| {
                let surface = surfaces[bodies[i / 6]].as_ref();
                let volume = surface.map_or(0.0, |s| s.properties.volume);
                let length = if i % 6 < 3 { 1.0 } else { volume.cbrt() };
                matrix[(i, i)].max(LEAST * volume * length.powi(2))
            })
            .collect();
        let mut out = Self {
            subject,
            fidelity: water.fidelity,
            bodies,
            poses,
            matrix,
            diagonal,
            surfaces,
            correction: None,
            films: films.map(|momenta| symmetric(&turn.tr_mul(&momenta))),
            turn,
            report,
        };
        if out.fidelity.kind().compresses() {
            out.correction = Some(out.correction(&out.submerged(&out.surfaces))?);
        }
        Ok(out)
    }

    pub fn scene(&self) -> &'a Scene {
        self.subject.scene
    }

    /// The bodies whose answers come from their meshes, by their numbers in the scene.
    pub fn meshed(&self) -> Vec<usize> {
        let alone = self.fidelity.kind().solves_alone();
        let submerged = self.submerged(&self.surfaces);
        let problem = self.problem(&submerged);
        let formula = |w| problem.method_for(w).is_ok_and(|m| m.by_formula());
        // What is given of a body is all that there is of one that feels no other.
        let unasked = |w: &SubmergedBody| w.added_mass.is_some() && !self.fidelity.coupled();
        let pairs = self.bodies.iter().zip(&submerged);
        let used = pairs.filter(|(_, w)| w.mesh.is_some() && !unasked(w) && !(alone && formula(w)));
        used.map(|(b, _)| *b).collect()
    }

    /// What no estimate is made of.
    pub fn unknown(&self) -> Vec<String> {
        let submerged = self.submerged(&self.surfaces);
        let given = submerged.iter().filter(|b| b.added_mass.is_some());
        let name = |body: &str| format!("the error of the added mass given for body {body:?}");
        given.map(|b| name(b.name)).collect()
    }

    /// max |D_ij| / √(M_ii M_jj); infinite where an entry isn't a number.
    pub fn size(&self, difference: &DMatrix<f64>) -> f64 {
        let mut worst = 0.0_f64;
        for i in 0..difference.nrows() {
            for j in 0..difference.ncols() {
                let scale = (self.diagonal[i] * self.diagonal[j]).sqrt();
                let off = difference[(i, j)].abs();
                if off.is_nan() {
                    return f64::INFINITY;
                }
                if scale > 0.0 {
                    worst = worst.max(off / scale);
                }
            }
        }
        worst
    }

    /// The bodies in the water with these surfaces.
    pub fn submerged<'b>(&'b self, surfaces: &'b [Option<Surface>]) -> Vec<SubmergedBody<'b>> {
        let coupled = self.subject.choices.fidelity.coupled();
        in_water(self.scene(), surfaces, self.subject.tree, coupled).1
    }

    fn problem<'b>(&'b self, bodies: &'b [SubmergedBody]) -> Problem<'b> {
        let Subject { choices, water, .. } = self.subject;
        let (method, numerics) = (water.method, &choices.numerics);
        Problem {
            plan: &water.plan,
            folder: water.folder.as_deref(),
            ..Problem::new(self.scene(), self.bodies, bodies, method, numerics)
        }
    }

    /// The added mass with these surfaces; where bodies are compressed, what [`Reduced`] is off if
    /// their answers are those of these surfaces.
    ///
    /// [`Reduced`]: crate::coupling::reduced::Reduced
    pub fn value(&self, surfaces: &[Option<Surface>]) -> Result<DMatrix<f64>> {
        let submerged = self.submerged(surfaces);
        if self.correction.is_some() {
            return self.correction(&submerged);
        }
        let mut device = self.subject.water.device.clone();
        let problem = self.problem(&submerged);
        let made = self.fidelity.couple(&problem, &mut device)?;
        Ok(evaluate(made.coupling.as_ref(), &self.poses, &self.turn)?.0)
    }

    /// The same with the scene's own surfaces.
    pub fn own(&self) -> &DMatrix<f64> {
        self.correction.as_ref().unwrap_or(&self.matrix)
    }

    /// What the compressed bodies' added mass is off if they answer as `bodies` do.
    fn correction(&self, bodies: &[SubmergedBody]) -> Result<DMatrix<f64>> {
        let own = self.submerged(&self.surfaces);
        let coupling = compressed_all(&self.problem(&own))?;
        let made = coupling.reduced_bodies().iter();
        let fits = made.map(|b| &b.parts().fit);
        let resolved: Vec<_> = fits.map(|fit| (fit.finest(), fit.halved)).collect();
        let responses = responses(&self.problem(bodies), &resolved)?;
        let mut out = coupling.correction(&self.poses, &self.turn, &responses)?;
        // Of a body whose own is given, what others and walls change is all that its answers tell.
        for (b, _) in (bodies.iter().enumerate()).filter(|(_, body)| body.added_mass.is_some()) {
            let compressed = coupling.reduced_bodies()[b].parts();
            let own = responses[b].added_mass() - compressed.added_mass;
            let turn = self.turn.rows(6 * b, 6);
            out -= turn.tr_mul(&(own * turn));
        }
        Ok(out)
    }

    /// What is left at check points, and what films may be off.
    pub fn residual(&self) -> Result<Option<f64>> {
        let films = self.films.as_ref().map(|films| FILM * self.size(films));
        if let Some(own) = &self.correction {
            let left = self.size(own) * self.narrowness();
            return Ok(Some(left + films.unwrap_or(0.0)));
        }
        let coupling = &self.subject.water.coupling;
        let found = coupling.residual(&self.poses, &self.turn)?;
        Ok(found.map(|d| self.size(&d)).or(films))
    }

    /// Where a gap is narrower than its compressed bodies resolve, their charges aren't what the first
    /// order takes them for: the root of what the gap lacks.
    fn narrowness(&self) -> f64 {
        let resolved = &self.subject.water.gap_model.resolved;
        let clearance = &self.subject.water.clearance;
        let poses = self.subject.poses;
        let lacks = |gaps: &Gaps| {
            let coarsest = resolved.iter().map(|r| r.everywhere).fold(0.0, f64::max);
            let all = gaps.within(poses, coarsest).into_iter();
            let ratios = all.filter_map(|gap| narrowest(gaps, &gap, poses, resolved));
            ratios.map(|(ratio, _)| 1.0 / ratio).fold(1.0, f64::max)
        };
        [&clearance.moving, &clearance.rigid]
            .map(lacks)
            .into_iter()
            .fold(1.0, f64::max)
            .sqrt()
            .min(NARROWEST)
    }

    /// The coupling that the fidelity `Isolated` leaves out.
    pub fn missing_coupling(&self, missing: &mut Vec<String>) -> Option<f64> {
        match self.left_out() {
            Ok(d) => Some(self.size(&d)),
            Err(error) => {
                missing.push(format!("the coupling that isolated leaves out: {error}"));
                None
            }
        }
    }

    fn left_out(&self) -> Result<DMatrix<f64>> {
        let scene = self.scene();
        let mut surfaces = Vec::with_capacity(scene.bodies.len());
        for (body, own) in scene.bodies.iter().zip(&self.surfaces) {
            let few = |s: &Surface| s.mesh.faces().len() <= COUPLING_FACES;
            let mesh = match (own, &body.shape) {
                (Some(own), _) if few(own) => Some(own.mesh.clone()),
                (Some(own), Some(shape)) if shape.is_mesh() => {
                    Some(own.mesh.coarsened(COUPLING_FACES)?)
                }
                (own, _) => {
                    // Refined regions keep their share of the faces.
                    let (fewer, base) = own.as_ref().map_or((1.0, COUPLING_FACES), |s| {
                        let fewer = COUPLING_FACES as f64 / s.mesh.faces().len() as f64;
                        (fewer, (s.base as f64 * fewer).round().max(1.0) as usize)
                    });
                    let meshing = Meshing {
                        faces: Some(base),
                        keeps: true,
                        by_formula: false,
                        pairs: false,
                    };
                    surface(body, meshing, 1.0 / fewer.sqrt())?.map(|s| s.mesh)
                }
            };
            surfaces.push(mesh.map(Surface::of_mesh));
        }
        let (numbers, mut submerged) = in_water(scene, &surfaces, self.subject.tree, true);
        // What is given for a body alone is the same in both.
        for body in &mut submerged {
            body.added_mass = None;
        }
        let n = 6 * self.bodies.len();
        if submerged.len() <= 1 && scene.walls.is_empty() {
            return Ok(DMatrix::zeros(n, n));
        }
        let poses: Vec<Pose> = numbers.iter().map(|b| self.subject.poses[*b]).collect();
        let turn = world_axes(&poses);
        let mut surfaces = scene.walls.iter().map(|w| w.surface);
        let fidelity = match surfaces.any(|s| s == WallSurface::Free) {
            true => Fidelity::Reduced,
            false => Fidelity::Full,
        };
        let numerics = Numerics::default();
        let method = Method::Panel.kind();
        let problem = Problem::new(scene, &numbers, &submerged, method, &numerics);
        let solve = |fidelity: Fidelity| -> Result<DMatrix<f64>> {
            let made = fidelity.couple(&problem, &mut Device::default())?;
            Ok(evaluate(made.coupling.as_ref(), &poses, &turn)?.0)
        };
        let difference = solve(fidelity)? - solve(Fidelity::Isolated)?;
        let at = |i: usize| {
            let of = numbers.iter().position(|b| *b == self.bodies[i / 6]);
            of.map(|b| 6 * b + i % 6)
        };
        Ok(DMatrix::from_fn(n, n, |i, j| match (at(i), at(j)) {
            (Some(i), Some(j)) => difference[(i, j)],
            _ => 0.0,
        }))
    }
}
