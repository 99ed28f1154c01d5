//! Single and double layer of flat triangles with constant density, in closed form.
//!
//! For a point x and panel j with corners v_0, v_1, v_2 (counter-clockwise seen along −n), e running
//! over its edges,
//!
//! ```text
//! Ω_j = ∫ n·(y − x)/|y − x|³ dA                       solid angle, positive for x behind
//! I_j = ∫ 1/|x − y| dA = Σ_e d_e L_e − n·(v_0 − x) Ω_j
//! d_e = m_e·(v_e − x)        distance in the panel's plane, m_e the edge's outward normal in it
//! L_e = ln (l + l' + |e|)/(l + l' − |e|)       l, l' the distances of x from the edge's ends
//! ```
//!
//! Two panels share each edge and its logarithm. All layers here are divided by 4π, and laid out
//! `[panel][point]`.
//!
//! # References
//! D. R. Wilton et al., "Potential integrals for uniform and linear source distributions on polygonal
//! and polyhedral domains", IEEE Trans. Antennas Propag. 32 (1984) 276–281, Eq. 5.

use crate::adjoint::kernel::{Sources, Triangles, Write, flux_fill};
use crate::adjoint::lie::Vec3;
use crate::geometry::{Faces, TriMesh};
use crate::solver::matmul;
use faer::{Accum, MatMut, MatRef};
use pulp::Arch;
use rayon::prelude::*;
use std::collections::HashMap;
use std::f64::consts::PI;

/// Points evaluated at once.
const LANES: usize = 8;
/// Points of one task: the same whatever the number of threads.
const BLOCK: usize = 64;
/// |e|/(l + l') up to which the series of the logarithm has all its digits.
const FAR: f64 = 0.25;

type Lane = [f64; LANES];

#[derive(Clone, Debug)]
struct Panel {
    /// v_0, m.
    corner: Vec3,
    normal: Vec3,
    /// Edges 01, 12, 20.
    edges: [u32; 3],
    /// m_e / 4π.
    outward: [Vec3; 3],
    /// m_12·(v_1 − v_0) / 4π, m.
    height: f64,
}

/// The panels of one body's surface, body frame.
#[derive(Clone, Debug)]
pub(crate) struct Panels {
    /// Row weights 1/4π.
    triangles: Triangles,
    vertices: Vec<Vec3>,
    /// Numbers of each panel's vertices.
    corners: Vec<[u32; 3]>,
    /// Ends and length of each edge.
    edges: Vec<([u32; 2], f64)>,
    panels: Vec<Panel>,
}

impl Panels {
    /// Of a mesh and its faces.
    pub fn new(mesh: &TriMesh, faces: &Faces) -> Self {
        let (vertices, normals, faces) = (mesh.vertices(), &faces.normals, mesh.faces());
        let mut edges = Vec::new();
        let mut known: HashMap<[usize; 2], u32> = HashMap::new();
        let panels = faces
            .iter()
            .zip(normals)
            .map(|(f, normal)| {
                let corners = f.map(|v| vertices[v]);
                let ends: [[usize; 2]; 3] = std::array::from_fn(|k| [f[k], f[(k + 1) % 3]]);
                let outward = std::array::from_fn(|k| {
                    let along = corners[(k + 1) % 3] - corners[k];
                    along.cross(normal).normalize() / (4.0 * PI)
                });
                Panel {
                    corner: corners[0],
                    normal: *normal,
                    edges: ends.map(|[a, b]| {
                        *known.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                            edges.push(([a as u32, b as u32], (vertices[b] - vertices[a]).norm()));
                            edges.len() as u32 - 1
                        })
                    }),
                    outward,
                    height: outward[1].dot(&(corners[1] - corners[0])),
                }
            })
            .collect();
        Self {
            triangles: Triangles::new(vertices, faces, vec![0.25 / PI; faces.len()]),
            vertices: vertices.to_vec(),
            corners: faces.iter().map(|f| f.map(|v| v as u32)).collect(),
            edges,
            panels,
        }
    }

    /// The triangles, row weights 1/4π.
    pub fn triangles(&self) -> &Triangles {
        &self.triangles
    }

    /// Vertices, m.
    pub fn vertices(&self) -> &[Vec3] {
        &self.vertices
    }

    /// Numbers of each panel's vertices.
    pub fn corners(&self) -> &[[u32; 3]] {
        &self.corners
    }

    /// Number of panels.
    pub fn len(&self) -> usize {
        self.panels.len()
    }

    /// Ω/4π into `out[panel · stride + column + point]`. A point within its own panel's plane gets
    /// ±½ from that panel and should be given 0 (the principal value).
    pub fn double_layer(
        &self,
        points: &[Vec3],
        write: Write,
        out: &mut [f64],
        stride: usize,
        column: usize,
    ) {
        let points = Sources::new(points);
        flux_fill(&self.triangles, &points, write, out, stride, column);
    }

    /// Ω/4π, `[panel][point]`.
    fn solid_angles(&self, points: &[Vec3]) -> Vec<f64> {
        let mut out = vec![0.0; self.len() * points.len()];
        self.double_layer(points, Write::Set, &mut out, points.len(), 0);
        out
    }

    /// I/4π, `[panel][point]`, from Ω/4π of the same points.
    fn single_layer(&self, points: &[Vec3], double: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; double.len()];
        let mut lengths = vec![[0.0; LANES]; self.vertices.len()];
        let mut logs = vec![[0.0; LANES]; self.edges.len()];
        for first in (0..points.len()).step_by(LANES) {
            let count = LANES.min(points.len() - first);
            let at = |p: usize| points[first + p.min(count - 1)];
            let x: [Lane; 3] = std::array::from_fn(|c| std::array::from_fn(|p| at(p)[c]));
            Arch::new().dispatch(|| self.lengths(&x, &mut lengths));
            Arch::new().dispatch(|| self.logs(&lengths, &mut logs));
            Arch::new().dispatch(|| {
                let rows = out.chunks_exact_mut(points.len());
                let rows = rows.zip(double.chunks_exact(points.len()));
                for (panel, (out, double)) in self.panels.iter().zip(rows) {
                    let mut omega = [0.0; LANES];
                    omega[..count].copy_from_slice(&double[first..first + count]);
                    let value = panel.single_layer(&x, &omega, &logs);
                    out[first..first + count].copy_from_slice(&value[..count]);
                }
            });
        }
        out
    }

    #[inline(always)]
    fn lengths(&self, x: &[Lane; 3], out: &mut [Lane]) {
        for (v, out) in self.vertices.iter().zip(out) {
            for p in 0..LANES {
                let (a, b, c) = (v.x - x[0][p], v.y - x[1][p], v.z - x[2][p]);
                out[p] = (a * a + b * b + c * c).sqrt();
            }
        }
    }

    #[inline(always)]
    fn logs(&self, lengths: &[Lane], out: &mut [Lane]) {
        for ((ends, e), out) in self.edges.iter().zip(out) {
            let (a, b) = (&lengths[ends[0] as usize], &lengths[ends[1] as usize]);
            let mut near = false;
            for p in 0..LANES {
                let t = e / (a[p] + b[p]);
                near |= t > FAR;
                out[p] = 2.0 * t * series(t * t);
            }
            if near {
                for p in 0..LANES {
                    let s = a[p] + b[p];
                    if *e > FAR * s {
                        // On the edge itself d = 0: any finite logarithm does.
                        out[p] = ((s + e) / (s - e).max(f64::EPSILON * s)).ln();
                    }
                }
            }
        }
    }

    /// `S single − Ω/4π double` at `points`, row-major points × columns: the potential outside of
    /// panels with the normal velocity `single` (into the fluid) and the potential `double`, both
    /// panels × columns.
    pub fn potential(
        &self,
        points: &[Vec3],
        single: Option<MatRef<f64>>,
        double: Option<MatRef<f64>>,
    ) -> Vec<f64> {
        let n = self.len();
        let columns = single.or(double).map_or(0, |m| m.ncols());
        let mut out = vec![0.0; points.len() * columns];
        if out.is_empty() {
            return out;
        }
        out.par_chunks_mut(BLOCK * columns)
            .zip(points.par_chunks(BLOCK))
            .for_each(|(out, points)| {
                let rows = points.len();
                let omega = self.solid_angles(points);
                let mut out = MatMut::from_row_major_slice_mut(out, rows, columns);
                if let Some(q) = single {
                    let s = self.single_layer(points, &omega);
                    // By panels and points: the matrix points × panels by columns.
                    let s = MatRef::from_column_major_slice(&s, rows, n);
                    matmul(out.as_mut(), Accum::Replace, s, q, 1.0);
                }
                if let Some(phi) = double {
                    let omega = MatRef::from_column_major_slice(&omega, rows, n);
                    matmul(out, Accum::Add, omega, phi, -1.0);
                }
            });
        out
    }
}

impl Panel {
    #[inline(always)]
    fn single_layer(&self, x: &[Lane; 3], omega: &Lane, logs: &[Lane]) -> Lane {
        let [l0, l1, l2] = self.edges.map(|e| &logs[e as usize]);
        let [m0, m1, m2] = &self.outward;
        let (n, v) = (&self.normal, &self.corner);
        // A loop, since a closure would be compiled without the processor's wide vectors.
        let mut out = [0.0; LANES];
        for p in 0..LANES {
            let (a, b, c) = (v.x - x[0][p], v.y - x[1][p], v.z - x[2][p]);
            let d0 = m0.x * a + m0.y * b + m0.z * c;
            let d1 = m1.x * a + m1.y * b + m1.z * c + self.height;
            let d2 = m2.x * a + m2.y * b + m2.z * c;
            let height = n.x * a + n.y * b + n.z * c;
            out[p] = d0 * l0[p] + d1 * l1[p] + d2 * l2[p] - height * omega[p];
        }
        out
    }
}

/// artanh(t)/t for u = t² ≤ [`FAR`]².
#[inline(always)]
fn series(u: f64) -> f64 {
    let mut sum = 0.0;
    for k in (0..14).rev() {
        sum = sum * u + 1.0 / f64::from(2 * k + 1);
    }
    sum
}
