//! Eq. 20 of one body above a plane wall, which it can rise from: K is square, by face sources as in the paper, and its part by the body's image changes with the height q.
//!
//! J = gᵀ K⁻¹ f, f the rows that a unit rise asks for, g what reads the body's momentum of the strengths; dJ/dq by several methods, here those that iterate.

use crate::spent::seconds;
use hydrograd::Shape;
use hydrograd::adjoint::kernel::{Sources, Write, normal_gradient};
use hydrograd::adjoint::lie::{Mat3, Pose, Vec3};
use hydrograd::adjoint::solve::{Columnwise, Operator, least_squares};
use hydrograd::boundary::{BodyBoundary, Depth, Method, MfsSettings, RowScaling};
use hydrograd::geometry::{Image, Wall};
use hydrograd::solver::{
    Columns, InverseCholesky, Outcome, cgls, normal_product, product, transposed_product,
};
use std::error::Error;
use std::path::Path;

/// Semi-axes, m.
const AXES: [f64; 3] = [0.3, 0.2, 0.1];
/// Depth of the sources in mean edges. Deeper ones are more accurate, but the diagonal alone is then a poor preconditioner: at 0.7 it takes six times as many iterations (980 faces), and at
/// the depth that the paper's preset has here thousands.
const DEPTH: f64 = 0.5;
/// Motion of the image's sources in the body's frame as the body rises.
const MOVED: Vec3 = Vec3::new(0.0, 0.0, -2.0);
const MAX_ITERATIONS: usize = 5000;
/// Bodies of more faces have a sparse factor in place of a dense one, of this ρ.
const DENSE: usize = 10_000;
const RHO: f64 = 3.0;

/// What one solve with its derivative came to.
pub struct Solved {
    /// J, and dJ/dq.
    pub value: f64,
    pub slope: f64,
    /// s
    pub forward: f64,
    /// s
    pub backward: f64,
    /// Of the conjugate gradients, forward and backward; 0 of what has none.
    pub iterations: usize,
}

pub type Made = Result<Solved, Box<dyn Error>>;

/// The body, and what doesn't change with its height.
pub struct Case {
    pub body: BodyBoundary,
    pub f: Columns,
    pub g: Columns,
    image: Image,
    sparse: Option<InverseCholesky>,
}

impl Case {
    /// With about so many faces, and the body's own factor if asked for: dense, or sparse where there are many.
    pub fn new(faces: usize, factored: bool) -> Result<Self, Box<dyn Error>> {
        let shape = Shape::ellipsoid(AXES);
        let mesh = hydrograd::shape::build(&shape, Path::new("."), Some(faces))?;
        // Of equilateral triangles.
        let edge = (4.0 * mesh.surface_area() / 3f64.sqrt() / mesh.faces().len() as f64).sqrt();
        let depth = Depth::Fixed(DEPTH * edge);
        let settings = MfsSettings {
            rows: RowScaling::Unscaled,
            ..MfsSettings::plain(Method::MfsFace, depth)
        };
        let dense = faces <= DENSE;
        let body = match factored && dense {
            true => BodyBoundary::new("body", &mesh, &settings)?,
            false => BodyBoundary::unfactored("body", &mesh, &settings)?,
        };
        let wall = Wall::rigid([0.0; 3], [0.0, 0.0, 1.0]);
        let image = Image::of_walls(&[wall])?.pop();
        let n = body.faces.len();
        let sparse = (factored && !dense).then(|| body.sparse_factor(RHO));
        Ok(Self {
            sparse: sparse.transpose()?,
            f: Columns::from_fn(n, 1, |i, _| body.twist_rows[i][2]),
            g: Columns::from_fn(n, 1, |j, _| body.readout[j][2]),
            image: image.ok_or("a wall has an image")?,
            body,
        })
    }

    /// Whether its factor is a sparse one.
    pub fn sparse(&self) -> bool {
        self.sparse.is_some()
    }

    pub fn size(&self) -> usize {
        self.body.faces.len()
    }

    /// The image's sources in the body's frame.
    fn mirrored(&self, height: f64) -> Vec<Vec3> {
        let at = Vec3::new(0.0, 0.0, height);
        let pose = Pose {
            rotation: Mat3::identity(),
            translation: at,
        };
        let (linear, shift) = self.image.placement(&pose);
        let sources = self.body.sources.iter();
        sources.map(|s| linear * s + shift - at).collect()
    }

    /// K, row-major.
    pub fn matrix(&self, height: f64) -> Vec<f64> {
        let (n, body) = (self.size(), &self.body);
        let mut k = if body.factored() {
            body.flux_rows.clone()
        } else {
            let mut k = vec![0.0; n * n];
            body.fill(&Sources::new(&body.sources), Write::Set, &mut k, n, 0);
            k
        };
        let mirrored = Sources::new(&self.mirrored(height));
        body.fill(&mirrored, Write::Add, &mut k, n, 0);
        k
    }

    /// Σ Kᵢⱼ-cotangent · dKᵢⱼ/dq, of a full matrix of cotangents.
    pub fn contracted(&self, height: f64, cotangent: impl Fn(usize, usize) -> f64) -> f64 {
        let points = &self.body.points;
        let (x, n, w) = (points.centres(), points.normals(), points.weights());
        let mut out = 0.0;
        for (j, s) in self.mirrored(height).iter().enumerate() {
            for i in 0..x.len() {
                out += cotangent(i, j) * normal_gradient(&x[i], &n[i], w[i], s).dot(&MOVED);
            }
        }
        out
    }

    /// leftᵀ (dK/dq) right of each column.
    fn between(&self, height: f64, left: &Columns, right: &Columns) -> Vec<f64> {
        let columns = left.columns;
        let mirrored = Sources::new(&self.mirrored(height));
        let fields = self.body.vjp(&mirrored, &left.data, columns);
        let mut out = vec![0.0; columns];
        for (at, field) in fields.chunks_exact(3).enumerate() {
            out[at % columns] += Vec3::from_column_slice(field).dot(&MOVED) * right.data[at];
        }
        out
    }
}

/// K as the solver's operator.
struct Matrix<'a>(&'a [f64]);

impl Operator<Columns> for Matrix<'_> {
    fn apply(&self, x: &Columns) -> Columns {
        product(self.0, self.0.len() / x.rows, x)
    }

    fn apply_transpose(&self, y: &Columns) -> Columns {
        transposed_product(self.0, self.0.len() / y.rows, y)
    }
}

fn reached(outcome: Outcome, tolerance: f64) -> Result<Outcome, String> {
    match outcome.residual <= tolerance {
        true => Ok(outcome),
        false => Err(format!(
            "residual {:.1e} after {} iterations",
            outcome.residual, outcome.iterations
        )),
    }
}

/// The paper's: conjugate gradients on the normal equations with the diagonal as preconditioner, and Eq. 21 by one more solve.
pub fn jacobi(case: &Case, height: f64, tolerance: f64) -> Made {
    let (n, start) = (case.size(), seconds());
    let k = case.matrix(height);
    let mut norms = vec![0.0; n];
    for row in k.chunks_exact(n) {
        norms.iter_mut().zip(row).for_each(|(sum, x)| *sum += x * x);
    }
    let scale = |x: &mut Columns| {
        let rows = x.data.iter_mut().zip(&norms);
        rows.for_each(|(x, norm)| *x /= norm.sqrt());
    };
    let normal = |b: &Columns| {
        let found = cgls(
            |x| normal_product(&k, n, x),
            scale,
            scale,
            b,
            tolerance,
            MAX_ITERATIONS,
        );
        reached(found, tolerance)
    };
    let a = normal(&transposed_product(&k, n, &case.f))?;
    let forward = seconds() - start;

    let start = seconds();
    let lambda = normal(&case.g)?;
    let mu = product(&k, n, &lambda.x);
    let slope = -case.between(height, &mu, &a.x)[0];
    Ok(Solved {
        value: case.g.dots(&a.x)[0],
        slope,
        forward,
        backward: seconds() - start,
        iterations: a.iterations + lambda.iterations,
    })
}

/// Ours: both solves at once, with the body's own factor as preconditioner; the cotangent of K, r λᵀ − μ aᵀ, is never formed.
pub fn factors(case: &Case, height: f64, tolerance: f64) -> Made {
    let (n, start) = (case.size(), seconds());
    let k = case.matrix(height);
    let normal = |b: &Columns| {
        let found = cgls(
            |x| normal_product(&k, n, x),
            |x| match &case.sparse {
                Some(factor) => *x = factor.apply(x),
                None => case.body.solve_factor(x.as_mat_mut()),
            },
            |x| match &case.sparse {
                Some(factor) => *x = factor.apply_transpose(x),
                None => case.body.solve_factor_transpose(x.as_mat_mut()),
            },
            b,
            tolerance,
            MAX_ITERATIONS,
        );
        reached(found, tolerance).map(|found| (found.x, found.iterations))
    };
    let (fitted, iterations) = least_squares(&Matrix(&k), normal, &case.f, &case.g)?;
    let forward = seconds() - start;

    let start = seconds();
    let left = fitted.mu.beside(&fitted.r);
    let parts = case.between(height, &left, &fitted.a.beside(&fitted.lambda));
    Ok(Solved {
        value: case.g.dots(&fitted.a)[0],
        slope: parts[1] - parts[0],
        forward,
        backward: seconds() - start,
        iterations,
    })
}
