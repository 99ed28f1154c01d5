//! Bodies whose faces are too few or too long for what is asked of them.

use super::surface::Surface;
use crate::geometry::MassProperties;
use crate::scene::{Body, Scene};
use crate::shape::{DEFAULT_FACES, Edges};

/// Part of a shape's volume that its faces may lose without a word.
const LOST: f64 = 0.1;

/// What is said of the bodies in the water where so many `faces` are asked for, the worst of each kind.
pub(crate) fn too_coarse(
    scene: &Scene,
    faces: Option<usize>,
    in_water: &[usize],
    surfaces: &[Option<Surface>],
) -> Vec<String> {
    let faces = faces.unwrap_or(DEFAULT_FACES);
    let seen = |b: &usize| Some((&scene.bodies[*b], surfaces[*b].as_ref()?));
    let bodies: Vec<(&Body, &Surface)> = in_water.iter().filter_map(seen).collect();
    let long = bodies.iter().filter_map(|(body, surface)| {
        let edges = Edges::of(&surface.mesh, faces);
        let told = edges.are_long() && is_mesh(body);
        told.then(|| (edges.longest / edges.asked, long_edges(body, &edges, faces)))
    });
    let lost = bodies.iter().filter_map(|(body, surface)| {
        let lost = lost(body, surface).filter(|lost| *lost > LOST)?;
        Some((lost, lost_volume(body, surface, lost)))
    });
    [worst(long), worst(lost)].into_iter().flatten().collect()
}

fn is_mesh(body: &Body) -> bool {
    body.shape.as_ref().is_some_and(|shape| shape.is_mesh())
}

/// The worst of what is said, and of how many more bodies it holds.
fn worst(all: impl Iterator<Item = (f64, String)>) -> Option<String> {
    let all: Vec<(f64, String)> = all.collect();
    let more = match all.len() {
        0 | 1 => String::new(),
        2 => "; one more body is like it".into(),
        n => format!("; {} more bodies are like it", n - 1),
    };
    let worst = all.into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
    worst.map(|(_, said)| said + &more)
}

fn long_edges(body: &Body, edges: &Edges, faces: usize) -> String {
    format!(
        "{}body {:?}: its mesh has edges as long as {:.3e} m, where {faces} even faces would have none over {:.3e} m: what the water does to it may be far off. \
         Give a mesh with shorter, more even faces",
        body.origin.surface(None),
        body.name,
        edges.longest,
        edges.asked
    )
}

/// Part of the volume of a shape by formula that its faces lose, where it is theirs that counts.
fn lost(body: &Body, surface: &Surface) -> Option<f64> {
    let shape = body.shape.as_ref()?;
    if shape.is_mesh() || surface.by_formula {
        return None;
    }
    let whole = MassProperties::by_formula(shape).ok()??;
    Some(1.0 - surface.properties.volume / whole.volume)
}

fn lost_volume(body: &Body, surface: &Surface, lost: f64) -> String {
    format!(
        "{}body {:?}: its {} faces have {:.0} % less volume than the shape that they stand for, and less added mass: use more faces (`faces`, by default {DEFAULT_FACES})",
        body.origin.surface(None),
        body.name,
        surface.mesh.faces().len(),
        100.0 * lost
    )
}
