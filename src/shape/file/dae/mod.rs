//! COLLADA (.dae): the triangles of all geometries that the scene shows, where its nodes place them.
//!
//! `mesh-loader` reads the geometries. The nodes are read here: it multiplies their matrices in the wrong order and places a geometry once only
//! (version 0.1.13), so it is given the file without them. Materials, images and cameras are passed over; so is `up_axis`, as robots' tools do: axes are those of the
//! numbers in the file.

use super::{Parsed, Raw};
use hydrograd_adjoint::lie::Vec3;
use mesh_loader::{Loader, Mesh};
use nalgebra::{Matrix4, Point3, Rotation3, Translation3, Unit, Vector3};
use roxmltree::{Document, Node};
use std::collections::HashMap;

/// Deepest nesting of nodes, and most geometries that they may place.
const DEEPEST: usize = 64;
const MOST_PLACED: usize = 10_000;
/// Most faces of all together.
const MOST_FACES: usize = 20_000_000;

/// Attributes that say how much there is.
const COUNTS: [&str; 4] = ["count", "stride", "offset", "set"];

/// What isn't read and may be left out of what the crate is given.
const LEFT_OUT: [&str; 12] = [
    "library_visual_scenes",
    "library_nodes",
    "library_images",
    "library_effects",
    "library_materials",
    "library_cameras",
    "library_lights",
    "library_animations",
    "library_controllers",
    "library_physics_scenes",
    "scene",
    "extra",
];

/// Reads all that the scene shows, in m; all geometries as they stand if there is no scene.
pub(super) fn parse(bytes: &[u8]) -> Parsed {
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let good = e.valid_up_to();
        format!("byte {good} is not UTF-8 text; save the file as UTF-8")
    })?;
    let text = text.trim_start_matches('\u{feff}');
    let document = Document::parse(text).map_err(|e| format!("{e}; export it again"))?;
    let root = document.root_element();
    let meshes = meshes(text, &root)?;
    let unit = child(&root, "asset").and_then(|asset| child(&asset, "unit"));
    let unit = unit.and_then(|unit| unit.attribute("meter")?.trim().parse::<f64>().ok());
    let unit = unit.unwrap_or(1.0);
    if !(unit.is_finite() && unit > 0.0) {
        return Err(format!("a unit of {unit} m; export it again"));
    }
    let whole = Matrix4::new_scaling(unit);
    let mut placed = Vec::new();
    match scene(&root) {
        Some(scene) => place(&root, &scene, whole, &mut placed)?,
        None => placed.extend(meshes.keys().map(|id| (id.clone(), whole))),
    }
    // The same in every run.
    if scene(&root).is_none() {
        placed.sort_by(|a, b| a.0.cmp(&b.0));
    }
    let mut raw = Raw::default();
    for (id, at) in &placed {
        let Some(mesh) = meshes.get(id) else {
            return Err(format!(
                "a node shows geometry {id:?}, which isn't there; export it again"
            ));
        };
        add(mesh, at, &mut raw)?;
    }
    Ok(raw)
}

/// The geometries by their names, as the crate reads them.
fn meshes(text: &str, root: &Node) -> Result<HashMap<String, Mesh>, String> {
    let mut rest = String::with_capacity(text.len());
    let mut at = 0;
    for part in root.children().filter(Node::is_element) {
        if LEFT_OUT.contains(&part.tag_name().name()) {
            let range = part.range();
            rest.push_str(&text[at..range.start]);
            at = range.end;
        }
    }
    rest.push_str(&text[at..]);
    // The crate makes room for what these say before it looks at what is there.
    for node in root.descendants().filter(Node::is_element) {
        for name in COUNTS {
            let Some(given) = node.attribute(name) else {
                continue;
            };
            let fits = |n: u64| n <= text.len() as u64;
            if given.trim().parse().is_ok_and(|n: u64| !fits(n)) {
                return Err(format!(
                    "<{}> has {name}=\"{given}\" in a file of {} bytes; export it again",
                    node.tag_name().name(),
                    text.len()
                ));
            }
        }
    }
    let read = Loader::default().load_collada_from_slice(rest.as_bytes(), "mesh.dae");
    let read = read.map_err(|e| format!("{e}; export it again"))?;
    let meshes = read.meshes.into_iter();
    Ok(meshes.map(|mesh| (mesh.name.clone(), mesh)).collect())
}

fn child<'a, 'd>(node: &Node<'a, 'd>, name: &str) -> Option<Node<'a, 'd>> {
    node.children()
        .find(|c| c.is_element() && c.tag_name().name() == name)
}

/// The element with this id that a link `#id` names.
fn named<'a, 'd>(root: &Node<'a, 'd>, kind: &str, link: &str) -> Option<Node<'a, 'd>> {
    let id = link.strip_prefix('#')?;
    let mut all = root.descendants();
    all.find(|n| n.is_element() && n.tag_name().name() == kind && n.attribute("id") == Some(id))
}

/// What the file shows.
fn scene<'a, 'd>(root: &Node<'a, 'd>) -> Option<Node<'a, 'd>> {
    let shown = child(root, "scene").and_then(|s| child(&s, "instance_visual_scene"));
    let shown = shown.and_then(|s| named(root, "visual_scene", s.attribute("url")?));
    shown.or_else(|| child(&child(root, "library_visual_scenes")?, "visual_scene"))
}

/// The geometries that a node and those below it show, with their matrices.
fn place(
    root: &Node,
    top: &Node,
    whole: Matrix4<f64>,
    placed: &mut Vec<(String, Matrix4<f64>)>,
) -> Result<(), String> {
    let mut open = vec![(*top, whole, 0)];
    let mut steps = 0;
    while let Some((node, above, depth)) = open.pop() {
        steps += 1;
        if depth > DEEPEST || steps > MOST_PLACED || placed.len() > MOST_PLACED {
            return Err("its nodes are nested too deep, or too many; export it again".into());
        }
        let mut at = above;
        let mut below = Vec::new();
        for inner in node.children().filter(Node::is_element) {
            let link = |kind: &str| {
                let found = inner
                    .attribute("url")
                    .and_then(|url| named(root, kind, url));
                found.ok_or_else(|| {
                    format!(
                        "<{}> leads nowhere; export it again",
                        inner.tag_name().name()
                    )
                })
            };
            match inner.tag_name().name() {
                "node" => below.push(inner),
                "instance_node" => below.push(link("node")?),
                "instance_geometry" => {
                    let id = link("geometry")?.attribute("id").unwrap_or_default();
                    placed.push((id.to_string(), at));
                }
                "lookat" | "skew" => {
                    return Err(format!(
                        "a node with <{}>, which isn't read; export it with matrices",
                        inner.tag_name().name()
                    ));
                }
                name => at *= matrix(name, &inner)?,
            }
        }
        let below = below.into_iter().rev();
        open.extend(below.map(|node| (node, at, depth + 1)));
    }
    Ok(())
}

/// The matrix of an element of a node; one of anything else.
fn matrix(name: &str, element: &Node) -> Result<Matrix4<f64>, String> {
    let count = match name {
        "matrix" => 16,
        "translate" | "scale" => 3,
        "rotate" => 4,
        _ => return Ok(Matrix4::identity()),
    };
    let words = element.text().unwrap_or_default().split_whitespace();
    let read: Option<Vec<f64>> = words.map(|w| w.parse().ok()).collect();
    let read = read.filter(|x| x.len() == count && x.iter().all(|x| x.is_finite()));
    let Some(x) = read else {
        return Err(format!(
            "<{name}> needs {count} finite numbers; export it again"
        ));
    };
    Ok(match name {
        "matrix" => Matrix4::from_row_slice(&x),
        "translate" => Translation3::new(x[0], x[1], x[2]).to_homogeneous(),
        "scale" => Matrix4::new_nonuniform_scaling(&Vector3::new(x[0], x[1], x[2])),
        _ => {
            let axis = Vector3::new(x[0], x[1], x[2]);
            match Unit::try_new(axis, 0.0) {
                Some(axis) => Rotation3::from_axis_angle(&axis, x[3].to_radians()).to_homogeneous(),
                None => Matrix4::identity(),
            }
        }
    })
}

fn add(mesh: &Mesh, at: &Matrix4<f64>, raw: &mut Raw) -> Result<(), String> {
    if raw.faces.len() + mesh.faces.len() > MOST_FACES {
        return Err(format!("more than {MOST_FACES} faces; export fewer"));
    }
    let first = raw.vertices.len();
    let vertices = mesh.vertices.iter().map(|x| -> Vec3 {
        let x = Point3::from(x.map(f64::from));
        at.transform_point(&x).coords
    });
    raw.vertices.extend(vertices);
    let mirrored = at.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
    raw.faces.extend(mesh.faces.iter().map(|face| {
        let [a, b, c] = face.map(|v| first + v as usize);
        if mirrored { [a, c, b] } else { [a, b, c] }
    }));
    Ok(())
}
