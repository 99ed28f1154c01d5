//! Where the sources go.

use super::settings::{Depth, Method};
use super::surface::Surface;
use crate::adjoint::lie::Vec3;
use crate::{Error, Result};

/// Local scales at one source, m.
pub(crate) struct Site {
    /// Point of the surface above the source.
    pub point: Vec3,
    /// Unit normal there, into the fluid.
    pub normal: Vec3,
    /// Mean edge length.
    pub edge: f64,
    /// Distance along −normal to the opposite surface.
    pub thickness: f64,
}

/// Points of the surface that get a source each, with their local scales.
pub(crate) fn sites(surface: &Surface, method: Method) -> Vec<Site> {
    let site = |point: Vec3, normal: Vec3, edge: f64, vertex: usize, face: usize| {
        let thickness = surface.ray(&point, &-normal, vertex, face);
        Site {
            point,
            normal,
            edge,
            thickness: thickness.unwrap_or(edge),
        }
    };
    match method {
        Method::MfsVertex => (0..surface.vertices.len())
            .map(|i| {
                let (x, n) = (surface.vertices[i], surface.vertex_normals[i]);
                site(x, n, surface.vertex_edge[i], i, usize::MAX)
            })
            .collect(),
        Method::MfsFace => (0..surface.faces.len())
            .map(|i| {
                let edge = surface.triangles[i]
                    .iter()
                    .map(|k| surface.vertex_edge[*k])
                    .sum::<f64>()
                    / 3.0;
                let (x, n) = (surface.faces.centres[i], surface.faces.normals[i]);
                site(x, n, edge, usize::MAX, i)
            })
            .collect(),
    }
}

/// Sources, their depths (m), and warnings.
pub(crate) fn place(
    surface: &Surface,
    method: Method,
    depth: Depth,
) -> Result<(Vec<Vec3>, Vec<f64>, Vec<String>)> {
    let sites = sites(surface, method);
    let mut warnings = Vec::new();
    let depths: Vec<f64> = match depth {
        Depth::Auto => sites.iter().map(|s| automatic(surface, s)).collect(),
        Depth::Fixed(d) => {
            check_fixed(surface.name, d, &sites, &mut warnings)?;
            vec![d; sites.len()]
        }
    };
    let sources = sites
        .iter()
        .zip(&depths)
        .map(|(s, d)| s.point - s.normal * *d)
        .collect();
    Ok((sources, depths, warnings))
}

/// Depth in edge lengths where the body is thick.
const EDGES: f64 = 1.2;
/// Largest depth in radii of the inner tangent ball.
const BALL: f64 = 0.75;

/// Depth of one source, m.
fn automatic(surface: &Surface, site: &Site) -> f64 {
    let radius = surface.ball(&site.point, &site.normal, site.thickness);
    let mut depth = (EDGES * site.edge).min(BALL * radius);
    // A safeguard for what points can't see of a coarse surface.
    for _ in 0..20 {
        let winding = surface.winding(&(site.point - site.normal * depth));
        if (winding - 1.0).abs() < 1e-6 {
            break;
        }
        depth *= 0.5;
    }
    depth
}

/// A user's own depth against what the mesh allows.
fn check_fixed(name: &str, d: f64, sites: &[Site], warnings: &mut Vec<String>) -> Result<()> {
    if !(d.is_finite() && d > 0.0) {
        return Err(Error::input(
            format!("body \"{name}\": source depth"),
            d,
            "a positive number of metres, or automatic",
        ));
    }
    let edge = sites.iter().map(|s| s.edge).sum::<f64>() / sites.len() as f64;
    let thin = sites.iter().map(|s| s.thickness).fold(f64::MAX, f64::min);
    if d < 0.5 * edge {
        warnings.push(format!(
            "body \"{name}\": source depth {d:.3e} m is {:.2} of the mean edge length {edge:.3e} m; \
             the added mass will be too small (use 1 to 1.5 edge lengths, or automatic)",
            d / edge
        ));
    }
    if d > 3.0 * edge {
        warnings.push(format!(
            "body \"{name}\": source depth {d:.3e} m is {:.1} mean edge lengths ({edge:.3e} m); \
             the equations become ill-conditioned (use 1 to 1.5 edge lengths, or automatic)",
            d / edge
        ));
    }
    if d > 0.45 * thin {
        warnings.push(format!(
            "body \"{name}\": source depth {d:.3e} m is {:.2} of the smallest thickness {thin:.3e} m; \
             sources from opposite sides meet (use less than a third, or automatic)",
            d / thin
        ));
    }
    Ok(())
}

/// Every source must be strictly inside.
pub(crate) fn check_inside(surface: &Surface, sources: &[Vec3]) -> Result<()> {
    for (i, s) in sources.iter().enumerate() {
        let winding = surface.winding(s);
        // A source on a vertex gives NaN.
        if winding.is_nan() || (winding - 1.0).abs() > 1e-6 {
            return Err(Error::Unresolved {
                place: format!(
                    "body \"{}\": source {i} of {} at {:?}",
                    surface.name,
                    sources.len(),
                    s.as_slice()
                ),
                quantity: "winding number of the surface around it".into(),
                value: winding,
                limit: 1.0,
                remedy: "sources must be inside the body: use a smaller source depth, automatic \
                         depth, or a finer mesh there"
                    .into(),
            });
        }
    }
    Ok(())
}
