//! The paper's own system (Eq. 18) of the falling ball as it starts: face sources, unscaled rows, K dense in memory.

use faer::{Mat, MatRef};
use hydrograd::adjoint::kernel::{Sources, Write};
use hydrograd::adjoint::lie::{Pose, Vec3};
use hydrograd::boundary::{BodyBoundary, Depth, Method, MfsSettings, RowScaling};
use hydrograd::solver::{Columns, InverseCholesky, normal_product, transposed_product};
use hydrograd::{Controls, Fidelity, Result, Scene, Settings, Simulator, shape};
use std::ops::Range;
use std::path::Path;
use std::time::Instant;

/// What moves: a body, and the component of its twist.
const MOVES: [(usize, usize); 4] = [(0, 2), (1, 1), (1, 2), (1, 3)];

/// The bodies in their places, with K.
pub struct System {
    pub bodies: Vec<BodyBoundary>,
    /// Of each body, among all.
    pub sources: Vec<Range<usize>>,
    /// All sources, world frame, m.
    pub points: Vec<Vec3>,
    /// Faces of all bodies.
    pub rows: usize,
    /// Time that the factors of the bodies took, s.
    pub factored_in: f64,
    k: Vec<f64>,
}

impl System {
    /// With the scene's faces, or so many a body.
    pub fn falling_ball(
        faces: Option<usize>,
    ) -> std::result::Result<Self, Box<dyn std::error::Error>> {
        let file =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/scenes/falling_ball_box.toml");
        let scene = Scene::load(file)?;
        let poses = start(&scene)?;
        let settings = MfsSettings {
            rows: RowScaling::Unscaled,
            ..MfsSettings::plain(Method::MfsFace, Depth::Auto)
        };
        let now = Instant::now();
        let mut bodies = Vec::new();
        for body in &scene.bodies {
            let shape = body
                .shape
                .as_ref()
                .ok_or("every body of the scene has a shape")?;
            let mesh = shape::build(shape, Path::new("."), faces)?;
            bodies.push(BodyBoundary::new(&body.name, &mesh, &settings)?);
        }
        let factored_in = now.elapsed().as_secs_f64();
        Ok(Self::new(bodies, &poses, factored_in))
    }

    fn new(bodies: Vec<BodyBoundary>, poses: &[Pose], factored_in: f64) -> Self {
        // Square: a source a face.
        let mut sources: Vec<Range<usize>> = Vec::new();
        for body in &bodies {
            let start = sources.last().map_or(0, |r| r.end);
            sources.push(start..start + body.sources.len());
        }
        let n = sources.last().map_or(0, |r| r.end);
        let placed = bodies.iter().zip(poses);
        let points: Vec<Vec3> = placed
            .flat_map(|(body, pose)| body.sources.iter().map(|s| pose.apply(s)))
            .collect();
        let mut k = vec![0.0; n * n];
        for ((body, pose), rows) in bodies.iter().zip(poses).zip(&sources) {
            let seen: Vec<Vec3> = points.iter().map(|s| pose.apply_inverse(s)).collect();
            let out = &mut k[rows.start * n..rows.end * n];
            body.fill(&Sources::new(&seen), Write::Set, out, n, 0);
        }
        Self {
            bodies,
            sources,
            points,
            rows: n,
            factored_in,
            k,
        }
    }

    /// KᵀK x.
    pub fn normal(&self, x: &Columns) -> Columns {
        normal_product(&self.k, self.rows, x)
    }

    /// KᵀF of what moves.
    pub fn right_sides(&self) -> Columns {
        let mut f = Columns::zeros(self.rows, MOVES.len());
        for (column, (body, component)) in MOVES.iter().enumerate() {
            let rows = self.sources[*body].clone();
            for (i, row) in rows.zip(&self.bodies[*body].twist_rows) {
                f.data[i * MOVES.len() + column] = row[*component];
            }
        }
        transposed_product(&self.k, self.points.len(), &f)
    }

    /// One over the norms of K's columns.
    pub fn diagonal(&self) -> Vec<f64> {
        let mut squares = vec![0.0; self.points.len()];
        for row in self.k.chunks_exact(self.points.len()) {
            squares.iter_mut().zip(row).for_each(|(s, x)| *s += x * x);
        }
        squares.iter().map(|s| 1.0 / s.sqrt()).collect()
    }

    /// The sparse factor over the sources of all bodies, as the paper has it in each frame.
    pub fn sparse(&self, rho: f64) -> InverseCholesky {
        // Column by column, so that a column lies together.
        let k = MatRef::from_row_major_slice(&self.k, self.rows, self.points.len()).to_owned();
        InverseCholesky::new(&self.points, rho, |among| {
            let part = Mat::from_fn(self.rows, among.len(), |i, a| k[(i, among[a])]);
            part.transpose() * &part
        })
    }
}

/// Where the bodies are at the start.
fn start(scene: &Scene) -> Result<Vec<Pose>> {
    let simulator = Simulator::new(scene, Settings::default().fidelity(Fidelity::Isolated))?;
    let rollout = simulator.rollout(&Controls::zeros(&simulator, 1))?;
    Ok(rollout.samples()[0].poses.clone())
}
