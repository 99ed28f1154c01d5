//! Shapes in one word: `sphere:0.05`, `box:1,2,3`.

use super::description::Shape;
use super::validate::validate;
use crate::error::{Error, Result};

/// Name, how many numbers, and how they are written.
const FORMS: [(&str, &str, &str); 6] = [
    ("sphere", "1 number(s)", "sphere:RADIUS"),
    ("ellipsoid", "3 number(s)", "ellipsoid:A,B,C (semi-axes)"),
    ("box", "3 number(s)", "box:A,B,C (edge lengths)"),
    ("cylinder", "2 number(s)", "cylinder:RADIUS,LENGTH"),
    (
        "capsule",
        "2 number(s)",
        "capsule:RADIUS,LENGTH (of the cylindrical part)",
    ),
    (
        "prism",
        "7 or more, an odd number of",
        "prism:LENGTH,Y1,Z1,Y2,Z2,Y3,Z3,… (convex profile, length along x)",
    ),
];

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
    let values = numbers.split(',').map(|n| n.trim().parse::<f64>().ok());
    let values: Option<Vec<f64>> = values.collect();
    let shape = match (kind.as_str(), values.as_deref()) {
        ("sphere", Some(&[radius])) => Shape::sphere(radius),
        ("ellipsoid", Some(&[a, b, c])) => Shape::ellipsoid([a, b, c]),
        ("box", Some(&[a, b, c])) => Shape::cuboid([a, b, c]),
        ("cylinder", Some(&[radius, length])) => Shape::cylinder(radius, length),
        ("capsule", Some(&[radius, length])) => Shape::capsule(radius, length),
        ("prism", Some([length, corners @ ..]))
            if corners.len() >= 6 && corners.len().is_multiple_of(2) =>
        {
            let corners = corners.chunks_exact(2).map(|p| [p[0], p[1]]);
            Shape::prism(corners.collect::<Vec<_>>(), *length)
        }
        _ => {
            let expected = format!("write {form}, {count} in metres");
            return Err(Error::input("shape", format!("{text:?}"), expected));
        }
    };
    validate(&shape, text)?;
    Ok(shape)
}

/// The short form of a shape (m), or the path of a mesh file: the name of its mesh.
pub fn shape_name(shape: &Shape) -> String {
    let numbers = match shape {
        Shape::Sphere { radius, .. } => vec![*radius],
        Shape::Ellipsoid { semi_axes, .. } => semi_axes.to_vec(),
        Shape::Box { size, .. } => size.to_vec(),
        Shape::Cylinder { radius, length, .. } | Shape::Capsule { radius, length, .. } => {
            vec![*radius, *length]
        }
        Shape::Prism {
            profile, length, ..
        } => [&[*length], profile.as_flattened()].concat(),
        Shape::Mesh { path, .. } => return path.display().to_string(),
        Shape::Triangles { faces, .. } => return format!("of {} triangles", faces.len()),
    };
    let numbers: Vec<String> = numbers.iter().map(|x| format!("{x:?}")).collect();
    format!("{}:{}", shape.kind(), numbers.join(","))
}
