//! Where the sources go.
//!
//! The field outside a body continues inwards as far as its medial axis and no farther, so a source's
//! depth is bounded by the inner tangent ball: the largest ball inside the body that touches the
//! surface at the source's point. Its radius ρ sees curvature, rims and the opposite side at
//! once. With h the local edge length, the depth is
//!
//! ```text
//! d = min(1.2 h, 0.7 ρ)
//! ```
//!
//! 1.2 h is where one source per vertex resolves the flux through a face without the
//! equations becoming ill-conditioned; 0.7 keeps sources of opposite sides apart.
//!
//! At an edge or corner (the normal turns by more than 55°) the flow on one side can't be made
//! by sources that serve the other side as well, so a vertex gets one source per smooth
//! side, below a point moved inwards on that side. A depth given by the user puts one source
//! under each vertex and checks it against edge length and thickness.
//!
//! # References
//! Ma, Bae & Choi 2012 (shrinking balls); the measurements are in `docs/accuracy.md`.

use super::settings::{Depth, Method};
use crate::adjoint::lie::Vec3;
use crate::geometry::{Interior, equilateral_edge};
use crate::{Error, Result};
use rayon::prelude::*;

/// Depth in edge lengths where the body is thick.
const EDGES: f64 = 1.2;
/// Largest depth in radii of the inner tangent ball.
const BALL: f64 = 0.7;
/// Angle between the normals, rad, from which an edge is sharp.
const SHARP: f64 = 0.96;
/// Where a side's source at a sharp edge is: this part of the way from the vertex to the middle of
/// the side's faces around it.
const SHIFT: f64 = 0.6;
/// Median depth in edge lengths below which a mesh is coarse for its thickness.
const COARSE: f64 = 0.32;
/// The same below which the added mass of a plate comes out at a half or less (13 % short at 0.12, 47 % at 0.06, 80 % at 0.03).
const HOPELESS: f64 = 0.1;
/// The same below which nothing of it is right.
const REFUSED: f64 = 0.04;

/// A point of the surface that gets a source, with its local scales in m.
struct Site {
    point: Vec3,
    /// Unit normal, into the fluid.
    normal: Vec3,
    /// Local edge length.
    edge: f64,
    /// Vertex and face that a ray from here doesn't hit.
    own: (usize, usize),
}

/// No vertex, or no face.
const NONE: usize = usize::MAX;

/// Mean size of the faces that meet at each vertex: the edge of an equilateral triangle of their area, m.
fn vertex_edges(surface: &Interior) -> Vec<f64> {
    let mut sums = vec![(0.0, 0usize); surface.vertex_normals.len()];
    for (t, area) in surface.mesh.faces().iter().zip(&surface.faces.areas) {
        for v in t {
            sums[*v].0 += equilateral_edge(*area);
            sums[*v].1 += 1;
        }
    }
    sums.iter().map(|(sum, n)| sum / *n as f64).collect()
}

/// One site per vertex; with `split` one per smooth side at sharp edges.
fn vertex_sites(surface: &Interior, split: bool) -> Vec<Site> {
    let (vertices, edges) = (surface.mesh.vertices(), vertex_edges(surface));
    let plain = |i: usize| Site {
        point: vertices[i],
        normal: surface.vertex_normals[i],
        edge: edges[i],
        own: (i, NONE),
    };
    let patches = surface.mesh.smooth_sides(SHARP);
    let count: usize = patches.iter().map(Vec::len).sum();
    // A very coarse mesh has too few rows for them.
    if !split || 10 * count > 9 * surface.faces.len() {
        return (0..vertices.len()).map(plain).collect();
    }
    let side = |i: usize, side: &Vec<usize>| {
        let (mut normal, mut middle) = (Vec3::zeros(), Vec3::zeros());
        for f in side {
            normal += surface.faces.normals[*f] * surface.faces.areas[*f];
            middle += surface.faces.centres[*f] / side.len() as f64;
        }
        let (site, norm) = (plain(i), normal.norm());
        Site {
            point: site.point + (middle - site.point) * SHIFT,
            // Faces of one side can't cancel, but a number should never be divided by 0.
            normal: if norm > 0.0 {
                normal / norm
            } else {
                site.normal
            },
            ..site
        }
    };
    let sides = |(i, list): (usize, &Vec<Vec<usize>>)| match list.len() {
        1 => vec![plain(i)],
        _ => list.iter().map(|s| side(i, s)).collect(),
    };
    patches.iter().enumerate().flat_map(sides).collect()
}

/// One site per face.
fn face_sites(surface: &Interior) -> Vec<Site> {
    let edges = vertex_edges(surface);
    let edge = |i: usize| surface.mesh.faces()[i].map(|v| edges[v]);
    (0..surface.faces.len())
        .map(|i| Site {
            point: surface.faces.centres[i],
            normal: surface.faces.normals[i],
            edge: edge(i).iter().sum::<f64>() / 3.0,
            own: (NONE, i),
        })
        .collect()
}

/// The sources, m, and what the user should know of them. Those that an automatic depth left outside a
/// coarse surface, where points don't show all of it, are moved towards it.
pub(crate) fn place(
    name: &str,
    surface: &Interior,
    method: Method,
    depth: Depth,
) -> Result<(Vec<Vec3>, Vec<String>)> {
    let sites = match method {
        Method::MfsVertex => vertex_sites(surface, depth == Depth::Auto),
        Method::MfsFace => face_sites(surface),
    };
    let thickness: Vec<f64> = sites
        .par_iter()
        .map(|s| {
            let hit = surface.ray(&s.point, &-s.normal, s.own.0, s.own.1);
            hit.unwrap_or(2.0 * s.edge)
        })
        .collect();
    let mut warnings = Vec::new();
    let depths: Vec<f64> = match depth {
        Depth::Auto => sites
            .par_iter()
            .zip(&thickness)
            .map(|(site, t)| {
                let radius = surface.tangent_ball(&site.point, &site.normal, *t);
                let mut d = (EDGES * site.edge).min(BALL * radius);
                for _ in 0..30 {
                    if surface.contains(&(site.point - site.normal * d)) {
                        break;
                    }
                    d *= 0.5;
                }
                d
            })
            .collect(),
        Depth::Fixed(d) => {
            check_fixed(name, d, &sites, &thickness, &mut warnings)?;
            vec![d; sites.len()]
        }
    };
    if depth == Depth::Auto {
        let mut ratios: Vec<f64> = sites.iter().zip(&depths).map(|(s, d)| d / s.edge).collect();
        ratios.sort_unstable_by(f64::total_cmp);
        let median = ratios[ratios.len() / 2];
        if median < REFUSED {
            return Err(Error::Unresolved {
                place: format!("body {name:?}"),
                quantity: "median depth of its sources, in edge lengths".into(),
                value: median,
                limit: REFUSED,
                remedy: format!(
                    "the body is far too thin for its {} faces: fundamental solutions would lose most of its \
                     added mass; use the method panel, the fidelity reduced or auto, or many more faces",
                    surface.faces.len()
                ),
            });
        }
        if median < COARSE {
            let off = match median < HOPELESS {
                true => {
                    "its added mass may come out at a half and less: use the method panel, or the fidelity reduced or auto"
                }
                false => "errors of 5 % and more are likely",
            };
            warnings.push(format!(
                "body \"{name}\": half of the sources are less than {median:.2} edge lengths deep: the mesh \
                 ({} faces) is coarse for a body this thin; {off}",
                surface.faces.len()
            ));
        }
    }
    let sources: Vec<Vec3> = sites
        .iter()
        .zip(&depths)
        .map(|(s, d)| s.point - s.normal * *d)
        .collect();
    check_inside(name, surface, &sources)?;
    Ok((sources, warnings))
}

/// A user's own depth against what the mesh allows.
fn check_fixed(
    name: &str,
    d: f64,
    sites: &[Site],
    thickness: &[f64],
    warnings: &mut Vec<String>,
) -> Result<()> {
    if !(d.is_finite() && d > 0.0) {
        return Err(Error::input(
            format!("body \"{name}\": source depth"),
            d,
            "a positive number of metres, or automatic",
        ));
    }
    let edge = sites.iter().map(|s| s.edge).sum::<f64>() / sites.len() as f64;
    let thin = thickness.iter().copied().fold(f64::INFINITY, f64::min);
    if d < 0.5 * edge {
        warnings.push(format!(
            "body \"{name}\": source depth {d:.3e} m is {:.2} of the mean edge length {edge:.3e} m; the \
             added mass will be too small (use 1 to 1.5 edge lengths, or automatic)",
            d / edge
        ));
    }
    if d > 3.0 * edge {
        warnings.push(format!(
            "body \"{name}\": source depth {d:.3e} m is {:.1} mean edge lengths ({edge:.3e} m); the \
             equations become ill-conditioned (use 1 to 1.5 edge lengths, or automatic)",
            d / edge
        ));
    }
    if d > 0.4 * thin {
        warnings.push(format!(
            "body \"{name}\": source depth {d:.3e} m is {:.2} of the smallest thickness {thin:.3e} m; \
             sources from opposite sides come close (use less than 0.4, or automatic)",
            d / thin
        ));
    }
    Ok(())
}

/// Every source must be strictly inside.
fn check_inside(name: &str, surface: &Interior, sources: &[Vec3]) -> Result<()> {
    let outside = sources.par_iter().position_first(|s| !surface.contains(s));
    let Some(i) = outside else { return Ok(()) };
    Err(Error::Unresolved {
        place: format!(
            "body \"{name}\": source {i} of {} at {:?}",
            sources.len(),
            sources[i].as_slice()
        ),
        quantity: "winding number of the surface around it".into(),
        value: surface.winding(&sources[i]),
        limit: 1.0,
        remedy: "sources must be inside the body: use a smaller or automatic source depth, or a \
                 finer mesh there"
            .into(),
    })
}
