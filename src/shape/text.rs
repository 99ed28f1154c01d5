//! Shapes in one word: `sphere:0.05`, `box:1,2,3`.

use super::description::Shape;
use super::validate::validate;
use crate::error::{Error, Result};

/// Name, how many numbers (zero: see [`counted`]), and how they are written.
const FORMS: [(&str, usize, &str); 6] = [
    ("sphere", 1, "sphere:RADIUS"),
    ("ellipsoid", 3, "ellipsoid:A,B,C (semi-axes)"),
    ("box", 3, "box:A,B,C (edge lengths)"),
    ("cylinder", 2, "cylinder:RADIUS,LENGTH"),
    (
        "capsule",
        2,
        "capsule:RADIUS,LENGTH (of the cylindrical part)",
    ),
    (
        "prism",
        0,
        "prism:LENGTH,Y1,Z1,Y2,Z2,Y3,Z3,… (convex profile, length along x)",
    ),
];

/// Whether a form of so many numbers takes `given`; a prism takes its length and three corners or more.
fn counted(form: usize, given: usize) -> bool {
    match form {
        0 => given >= 7 && given % 2 == 1,
        _ => given == form,
    }
}

/// A shape from its short form, lengths in m: `sphere:R`, `ellipsoid:A,B,C` (semi-axes),
/// `box:A,B,C` (edge lengths), `cylinder:R,L`, `capsule:R,L` (both along z; a capsule's L is
/// without its ends), `prism:L,Y1,Z1,Y2,Z2,Y3,Z3,…` (length along x, then the profile's corners).
///
/// # Errors
/// [`Error::Input`] with the forms that are understood, or naming the number that can't be.
pub fn parse_shape(text: &str) -> Result<Shape> {
    let (kind, numbers) = text.split_once(':').unwrap_or((text, ""));
    let kind = kind.trim().to_ascii_lowercase();
    let Some((_, count, form)) = FORMS.iter().find(|(name, ..)| *name == kind) else {
        let forms = FORMS.map(|(_, _, form)| form).join(", ");
        let near = FORMS
            .iter()
            .map(|(name, ..)| (strsim::damerau_levenshtein(name, &kind), name))
            .min()
            .filter(|(distance, name)| 2 * distance <= name.len().min(kind.len()));
        let hint = match near {
            Some((_, name)) => format!("did you mean {name}? Known are {forms}"),
            None => format!("known are {forms}"),
        };
        return Err(Error::input("shape", format!("{text:?}"), hint));
    };
    let values = numbers
        .split(',')
        .map(|n| n.trim().parse::<f64>())
        .collect::<std::result::Result<Vec<_>, _>>()
        .ok()
        .filter(|v| counted(*count, v.len()))
        .ok_or_else(|| {
            let count = match count {
                0 => "7 or more, an odd number of".to_owned(),
                n => format!("{n} number(s)"),
            };
            Error::input(
                "shape",
                format!("{text:?}"),
                format!("write {form}, {count} in metres"),
            )
        })?;
    let faces = None;
    let shape = match kind.as_str() {
        "sphere" => Shape::Sphere {
            radius: values[0],
            faces,
        },
        "ellipsoid" => Shape::Ellipsoid {
            semi_axes: [values[0], values[1], values[2]],
            faces,
        },
        "box" => Shape::Box {
            size: [values[0], values[1], values[2]],
            faces,
        },
        "cylinder" => Shape::Cylinder {
            radius: values[0],
            length: values[1],
            faces,
        },
        "capsule" => Shape::Capsule {
            radius: values[0],
            length: values[1],
            faces,
        },
        _ => Shape::Prism {
            length: values[0],
            profile: values[1..].chunks_exact(2).map(|p| [p[0], p[1]]).collect(),
            faces,
        },
    };
    validate(&shape, text)?;
    Ok(shape)
}

/// The short form of a shape (m), or the path of a mesh file: the name of its mesh.
pub fn shape_name(shape: &Shape) -> String {
    match shape {
        Shape::Sphere { radius, .. } => format!("sphere:{radius:?}"),
        Shape::Ellipsoid {
            semi_axes: [a, b, c],
            ..
        } => format!("ellipsoid:{a:?},{b:?},{c:?}"),
        Shape::Box {
            size: [a, b, c], ..
        } => format!("box:{a:?},{b:?},{c:?}"),
        Shape::Cylinder { radius, length, .. } => format!("cylinder:{radius:?},{length:?}"),
        Shape::Capsule { radius, length, .. } => format!("capsule:{radius:?},{length:?}"),
        Shape::Prism {
            profile, length, ..
        } => {
            let corners = profile.iter().map(|[y, z]| format!(",{y:?},{z:?}"));
            format!("prism:{length:?}{}", corners.collect::<String>())
        }
        Shape::Mesh { path, .. } => path.display().to_string(),
        Shape::Triangles { faces, .. } => format!("of {} triangles", faces.len()),
    }
}
