//! The file as one that leaves nothing to be looked up: no includes, no classes, and of elements and attributes those that are read.

use super::attributes::{DRIVE, numbers, read};
use super::classes::Classes;
use super::element::{Element, TURNS};
use super::general::general;
use super::geometry::{between, z_along};
use crate::Result;
use nalgebra::{UnitQuaternion, Vector3};

/// Sections, in the order in which they are to be read.
const SECTIONS: [&str; 5] = ["compiler", "asset", "worldbody", "equality", "actuator"];
/// Shapes that may lie between two points.
const LONG: [&str; 4] = ["capsule", "cylinder", "box", "ellipsoid"];

/// The file with one section of each kind.
///
/// # Errors
/// Classes that aren't there or are there twice, and what elements can't be once they have what their classes give.
pub(super) fn flat(file: &Element) -> Result<Element> {
    let classes = Classes::of(file)?;
    let mut made = own(file, "mujoco");
    let [
        mut compiler,
        mut asset,
        mut world,
        mut equality,
        mut actuator,
    ] = SECTIONS.map(|tag| Element::at(tag, file));
    for section in file.all("compiler") {
        for (name, value) in &own(section, "compiler").attributes {
            compiler.set(name, value);
        }
    }
    for mesh in file.all("asset").flat_map(|section| section.all("mesh")) {
        let mesh = classes.resolved(mesh, "mesh", None)?;
        asset.children.push(own(&mesh, "mesh"));
    }
    for section in file.all("worldbody") {
        content(&classes, section, None, &mut world)?;
    }
    for section in file.all("equality") {
        for one in &section.children {
            match &one.tag[..] {
                "joint" => {
                    let one = classes.resolved(one, "equality", None)?;
                    equality.children.push(own(&one, "coupling"));
                }
                // Of these it is told that they are there.
                tag @ ("connect" | "weld" | "tendon") => {
                    equality.children.push(Element::at(tag, one));
                }
                _ => {}
            }
        }
    }
    let joints = joints(&world);
    for coupling in equality.all("joint") {
        has_one_coordinate(coupling, &joints)?;
    }
    for one in file.all("actuator").flat_map(|section| &section.children) {
        for joint in ["joint", "jointinparent"] {
            has_joint(one, joint, &joints, "the actuators")?;
        }
        has_site(one, file)?;
        let given = general(&classes, one)?;
        let mut made = own(&given, DRIVE);
        // Its force would be in the frame of the other site.
        if given.get("refsite").is_some() {
            made.attributes.retain(|(name, _)| name != "site");
        }
        // Of a joint with one coordinate both are the same.
        if let Some(joint) = made.get("jointinparent").map(String::from) {
            made.set("joint", &joint);
        }
        actuator.children.push(made);
    }
    made.children = vec![compiler, asset, world, equality, actuator];
    Ok(made)
}

/// All joints of bodies.
fn joints(world: &Element) -> Vec<&Element> {
    let mut joints = Vec::new();
    let mut open = vec![world];
    while let Some(element) = open.pop() {
        let own = element.children.iter();
        joints.extend(own.clone().filter(|e| e.tag.ends_with("joint")));
        open.extend(own);
    }
    joints
}

/// The joint that an attribute names, if it is there.
///
/// # Errors
/// A joint that isn't there; `of` is where the attribute is.
fn has_joint<'e>(
    element: &Element,
    attribute: &str,
    joints: &[&'e Element],
    of: &str,
) -> Result<Option<&'e Element>> {
    let Some(name) = element.get(attribute).filter(|name| !name.is_empty()) else {
        return Ok(None);
    };
    let found = joints.iter().find(|j| j.get("name") == Some(name));
    match found {
        Some(found) => Ok(Some(found)),
        None => {
            let what = format!("{attribute} = {name:?}: there is no such joint");
            Err(element.wrong_of(of, what))
        }
    }
}

/// Refuses actuators of sites that aren't there.
fn has_site(actuator: &Element, file: &Element) -> Result<()> {
    let Some(name) = actuator.get("site").filter(|name| !name.is_empty()) else {
        return Ok(());
    };
    let mut open: Vec<&Element> = file.all("worldbody").collect();
    while let Some(element) = open.pop() {
        if element.tag == "site" && element.get("name") == Some(name) {
            return Ok(());
        }
        open.extend(&element.children);
    }
    let what = format!("site = {name:?}: there is no such site");
    Err(actuator.wrong_of("the actuators", what))
}

/// Refuses equalities of joints that aren't there, or have more than one coordinate.
fn has_one_coordinate(coupling: &Element, joints: &[&Element]) -> Result<()> {
    let of = "the equalities";
    for end in ["joint1", "joint2"] {
        let Some(joint) = has_joint(coupling, end, joints, of)? else {
            continue;
        };
        let kind = match &joint.tag[..] {
            "freejoint" => "free",
            _ => joint.get("type").unwrap_or("hinge"),
        };
        if !["hinge", "slide"].contains(&kind) {
            let name = coupling.get(end).unwrap_or_default();
            let what = format!(
                "{end} = {name:?} is a {kind} joint: only hinges and slides have the one coordinate that an <equality> couples"
            );
            return Err(coupling.wrong_of(of, what));
        }
    }
    Ok(())
}

/// An element without its children, and without attributes that aren't read.
fn own(element: &Element, kind: &str) -> Element {
    let mut made = Element::at(&element.tag, element);
    let kept = (element.attributes.iter())
        .filter(|(name, _)| read(kind, name).is_some() && !name.ends_with("class"));
    made.attributes = kept.cloned().collect();
    if let Some(&[x, y, z]) = made.get("zaxis").and_then(numbers).as_deref() {
        turn(&mut made, &z_along(Vector3::new(x, y, z)));
    }
    // The coefficients of higher order are zero.
    for name in ["stiffness", "damping"] {
        let linear = made.get(name).and_then(|all| all.split_whitespace().next());
        if let Some(linear) = linear.map(String::from) {
            made.set(name, &linear);
        }
    }
    made
}

fn turn(element: &mut Element, turn: &UnitQuaternion<f64>) {
    let turn = turn.quaternion();
    let value = format!("{} {} {} {}", turn.w, turn.i, turn.j, turn.k);
    element.set("quat", &value);
}

/// What is in a body, or a frame of one; `around` is the class of what is around it.
fn content(
    classes: &Classes,
    from: &Element,
    around: Option<usize>,
    into: &mut Element,
) -> Result<()> {
    let around = classes.named(from, "childclass")?.or(around);
    for inner in &from.children {
        let tag = &inner.tag[..];
        let made = match tag {
            "body" | "frame" => {
                let mut made = own(inner, tag);
                content(classes, inner, around, &mut made)?;
                made
            }
            "inertial" | "freejoint" => own(inner, tag),
            "joint" => own(&classes.resolved(inner, tag, around)?, tag),
            "geom" => geom(own(&classes.resolved(inner, tag, around)?, tag))?,
            "site" => site(own(&classes.resolved(inner, tag, around)?, tag)),
            _ => continue,
        };
        into.children.push(made);
    }
    Ok(())
}

fn unplace(element: &mut Element) {
    (element.attributes).retain(|(name, _)| name != "pos" && !TURNS.contains(&&name[..]));
}

/// Points that it lies between say where it is.
fn geom(mut made: Element) -> Result<Element> {
    let kind = made.get("type").unwrap_or("sphere").to_owned();
    if made.get("fromto").is_some() {
        if !LONG.contains(&&kind[..]) {
            let what = format!(
                "a {kind} can't lie between two points (fromto): {} can",
                LONG.join(", ")
            );
            return Err(made.wrong(what));
        }
        unplace(&mut made);
    }
    if let Some(mesh) = made.get("mesh").filter(|_| kind != "mesh" && kind != "sdf") {
        let what = format!(
            "a {kind} that is fitted to the mesh {mesh:?} isn't read: write its size, or type=\"mesh\""
        );
        return Err(made.wrong(what));
    }
    // Bits of groups: here it counts whether there are any.
    for name in ["contype", "conaffinity"] {
        let bits = made
            .get(name)
            .and_then(|bits| bits.trim().parse::<i64>().ok());
        if let Some(bits) = bits {
            made.set(name, if bits == 0 { "0" } else { "1" });
        }
    }
    Ok(made)
}

/// Points that it lies between are its middle and its axis.
fn site(mut made: Element) -> Element {
    let ends = made.get("fromto").and_then(numbers);
    if let Some(&[a, b, c, d, e, f]) = ends.as_deref() {
        unplace(&mut made);
        let at = between([a, b, c], [d, e, f]);
        let [x, y, z]: [f64; 3] = at.translation.vector.into();
        made.set("pos", &format!("{x} {y} {z}"));
        turn(&mut made, &at.rotation);
    }
    (made.attributes).retain(|(name, _)| name != "fromto");
    made
}
