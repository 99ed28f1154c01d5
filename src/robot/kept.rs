//! What of a URDF file is read, as a text of its own: of that alone the typed form is made, so that nothing else can be wrong with it.

use super::known::{needed_attributes, read_attributes};
use super::tree::unplaced;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector4};
use quick_xml::Writer;
use roxmltree::Node;

/// The text of a file that has been looked through, of a format of this version.
pub(super) fn kept(robot: &Node, version: [u32; 2]) -> Result<String, String> {
    let mut writer = Writer::new(Vec::new());
    write(&mut writer, robot, "", version).map_err(|e| e.to_string())?;
    String::from_utf8(writer.into_inner()).map_err(|e| e.to_string())
}

fn write(
    writer: &mut Writer<Vec<u8>>,
    node: &Node,
    parent: &str,
    version: [u32; 2],
) -> Result<(), quick_xml::Error> {
    let tag = node.tag_name().name();
    let read = read_attributes(parent, tag).unwrap_or_default();
    let needed = needed_attributes(tag, version);
    let turned = rpy(node, version);
    let own = node.attributes().filter(|a| {
        let name = a.name();
        let is_read = read.contains(&name) || needed.contains(&name);
        a.namespace().is_none() && is_read && name != "quat_xyzw"
    });
    let attributes = own.map(|a| (a.name(), a.value()));
    let attributes = attributes.chain(turned.as_deref().map(|rpy| ("rpy", rpy)));
    let start = writer.create_element(tag).with_attributes(attributes);
    let inner = node.children().filter(|child| {
        let of = child.tag_name();
        child.is_element()
            && of.namespace() == node.tag_name().namespace()
            && read_attributes(tag, of.name()).is_some()
    });
    let inner: Vec<Node> = inner.collect();
    if inner.is_empty() {
        start.write_empty()?;
        return Ok(());
    }
    start.write_inner_content(|writer| {
        (inner.iter()).try_for_each(|child| write(writer, child, tag, version))
    })?;
    Ok(())
}

/// What the quaternion of an element is as `rpy`: to the last digits also where the pitch is next to a right angle, which `urdf-rs` makes one.
fn rpy(node: &Node, version: [u32; 2]) -> Option<String> {
    let given = (node.attribute("quat_xyzw")).filter(|_| version >= [1, 1])?;
    let words = given.split_whitespace().map(|word| word.parse().ok());
    let numbers: Vec<f64> = words.collect::<Option<_>>()?;
    let [x, y, z, w] = numbers[..] else {
        return None;
    };
    // The square of a tiny one is zero.
    let quaternion = Vector4::new(x, y, z, w);
    let quaternion = Quaternion::from(quaternion / quaternion.amax());
    let turn = UnitQuaternion::from_quaternion(quaternion);
    let pose = unplaced(&Isometry3::from_parts(Translation3::identity(), turn));
    let [roll, pitch, yaw] = *pose.rpy;
    Some(format!("{roll} {pitch} {yaw}"))
}
