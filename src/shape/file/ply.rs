//! PLY, text and binary: the elements `vertex` (x, y, z) and `face` (`vertex_indices`).

use super::{Parsed, Raw, brief};
use hydrograd_adjoint::lie::Vec3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType,
    ScalarType,
};

/// One vertex or face, with what a surface needs of it.
struct Element {
    position: [Option<f64>; 3],
    corners: Option<Vec<i64>>,
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self {
            position: [None; 3],
            corners: None,
        }
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        match name {
            "x" => self.position[0] = scalar(&value),
            "y" => self.position[1] = scalar(&value),
            "z" => self.position[2] = scalar(&value),
            "vertex_indices" | "vertex_index" => self.corners = list(value),
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

fn scalar(value: &Property) -> Option<f64> {
    Some(match *value {
        Property::Char(x) => f64::from(x),
        Property::UChar(x) => f64::from(x),
        Property::Short(x) => f64::from(x),
        Property::UShort(x) => f64::from(x),
        Property::Int(x) => f64::from(x),
        Property::UInt(x) => f64::from(x),
        Property::Float(x) => f64::from(x),
        Property::Double(x) => x,
        _ => return None,
    })
}

fn list(value: Property) -> Option<Vec<i64>> {
    fn wide<T: Into<i64>>(list: Vec<T>) -> Option<Vec<i64>> {
        Some(list.into_iter().map(Into::into).collect())
    }
    match value {
        Property::ListChar(l) => wide(l),
        Property::ListUChar(l) => wide(l),
        Property::ListShort(l) => wide(l),
        Property::ListUShort(l) => wide(l),
        Property::ListInt(l) => wide(l),
        Property::ListUInt(l) => wide(l),
        _ => None,
    }
}

/// Reads vertices and faces.
pub(super) fn parse(bytes: &[u8]) -> Parsed {
    // A mark of the encoding, which text may begin with.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut reader = Reader::new(bytes);
    let parser = Parser::<Element>::new();
    let header = parser
        .read_header(&mut reader)
        .map_err(|e| format!("header: {}; export it again", brief(&e.to_string())))?;
    fits(&header, reader.get_ref().len())?;
    let mut payload = parser.read_payload(&mut reader, &header).map_err(|e| {
        format!(
            "{}; the file may be cut off: export it again",
            brief(&e.to_string())
        )
    })?;

    let mut take = |name: &str| payload.swap_remove(name).unwrap_or_default();
    let mut raw = Raw::default();
    for (i, vertex) in take("vertex").into_iter().enumerate() {
        let [Some(x), Some(y), Some(z)] = vertex.position else {
            return Err(format!(
                "vertex {i} lacks a number x, y or z; export positions as x, y, z"
            ));
        };
        raw.vertices.push(Vec3::new(x, y, z));
    }
    for (i, face) in take("face").into_iter().enumerate() {
        let corners = face.corners.ok_or(
            "the faces have no list of integers `vertex_indices`; export it again with faces",
        )?;
        let corners = corners
            .into_iter()
            .map(usize::try_from)
            .collect::<std::result::Result<Vec<_>, _>>()
            .map_err(|_| format!("face {i} has a negative vertex number; count from 0"))?;
        if corners.len() < 3 {
            return Err(format!(
                "face {i} has {} corners; delete faces with fewer than three",
                corners.len()
            ));
        }
        raw.add_face(&corners)
            .map_err(|e| format!("face {i} has {e}"))?;
    }
    Ok(raw)
}

/// Whether as many bytes follow as the declared counts take at least: a count is only a number in
/// the header, and nothing is stored for its sake before this is known.
fn fits(header: &Header, bytes: usize) -> Result<(), String> {
    let mut needed = 0u128;
    for (name, element) in &header.elements {
        if element.properties.is_empty() && element.count > 0 {
            return Err(format!("element {name} has no properties; export it again"));
        }
        needed += least(element, header.encoding) * element.count as u128;
        if needed > bytes as u128 {
            return Err(format!(
                "the header declares {} of element {name}, which take at least {needed} bytes; {bytes} follow: the file is cut off, export it again",
                element.count
            ));
        }
    }
    Ok(())
}

/// Fewest bytes of one element.
fn least(element: &ElementDef, encoding: Encoding) -> u128 {
    let size = |t: &ScalarType| match t {
        _ if encoding == Encoding::Ascii => 1,
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    };
    element
        .properties
        .values()
        .map(|p| match &p.data_type {
            PropertyType::Scalar(t) | PropertyType::List(t, _) => size(t),
        })
        .sum()
}
