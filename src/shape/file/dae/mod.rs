//! COLLADA (.dae): the polygons of all geometries that the scene shows, where its nodes place them.
//!
//! Materials, images and cameras are passed over; so is `up_axis`, as robots' tools do: axes are those of the
//! numbers in the file.

mod geometry;

use super::{Parsed, Raw};
use geometry::{Geometry, child, named};
use nalgebra::{Matrix4, Point3, Rotation3, Translation3, Unit, Vector3};
use roxmltree::{Document, Node};
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// Deepest nesting of nodes, and most geometries that they may place.
const DEEPEST: usize = 64;
const MOST_PLACED: usize = 10_000;
/// Most faces, and most vertices, of all together.
const MOST_FACES: usize = 20_000_000;

/// Reads all that the scene shows, in m; all geometries as they stand if there is no scene.
pub(super) fn parse(bytes: &[u8]) -> Parsed {
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let good = e.valid_up_to();
        format!("byte {good} is not UTF-8 text; save the file as UTF-8")
    })?;
    let text = text.trim_start_matches('\u{feff}');
    let document = Document::parse(text).map_err(|e| format!("{e}; export it again"))?;
    let root = document.root_element();
    if root.tag_name().name() != "COLLADA" {
        return Err(format!(
            "its root is <{}>, not <COLLADA>; export it again",
            root.tag_name().name()
        ));
    }
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
        None => placed.extend(all(&root).into_iter().map(|id| (id, whole))),
    }
    let mut raw = Raw::default();
    let mut met: HashMap<&str, Geometry> = HashMap::new();
    for (id, at) in &placed {
        let geometry = match met.entry(id) {
            Entry::Occupied(met) => met.into_mut(),
            Entry::Vacant(new) => {
                let read = named(&root, "geometry", &format!("#{id}"))
                    .ok_or_else(|| "it isn't there; export it again".to_string())
                    .and_then(|element| geometry::read(&root, &element));
                new.insert(read.map_err(|e| format!("geometry {id:?}: {e}"))?)
            }
        };
        add(geometry, at, &mut raw).map_err(|e| format!("geometry {id:?}: {e}"))?;
    }
    Ok(raw)
}

/// The names of all geometries that are meshes.
fn all(root: &Node) -> Vec<String> {
    let meshes = root.descendants().filter(|n| {
        n.is_element() && n.tag_name().name() == "geometry" && child(n, "mesh").is_some()
    });
    meshes
        .filter_map(|n| n.attribute("id"))
        .map(String::from)
        .collect()
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
                "instance_controller" => {
                    return Err(
                        "a node with <instance_controller>, a shape that a skeleton or a morph deforms, which isn't read; export the shape itself, without its modifiers"
                            .into(),
                    );
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

/// Adds a geometry where it is placed.
fn add(geometry: &Geometry, at: &Matrix4<f64>, raw: &mut Raw) -> Result<(), String> {
    let faces = raw.faces.len() + geometry.triangles();
    if faces.max(raw.vertices.len() + geometry.vertices.len()) > MOST_FACES {
        return Err(format!(
            "more than {MOST_FACES} faces or vertices; export fewer"
        ));
    }
    let first = raw.vertices.len();
    let vertices = geometry.vertices.iter();
    let vertices = vertices.map(|x| at.transform_point(&Point3::from(*x)).coords);
    raw.vertices.extend(vertices);
    let mirrored = at.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
    for polygon in geometry.polygons() {
        let mut corners: Vec<usize> = polygon.iter().map(|v| first + v).collect();
        if mirrored {
            corners[1..].reverse();
        }
        raw.add_face(&corners)
            .map_err(|e| format!("a polygon with {e}"))?;
    }
    Ok(())
}
