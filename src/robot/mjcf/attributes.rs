//! The attributes of elements that are read, what they may be, and those that MJCF has besides.

use super::super::file::{LARGEST, numbers_asked};
use super::element::{Element, TURNS};
use crate::Result;

/// What an attribute is.
#[derive(Clone, Copy)]
pub(super) enum Kind {
    /// A name or a path.
    Text,
    /// One of these words.
    One(&'static [&'static str]),
    /// So many numbers, fewest and most.
    Numbers(usize, usize),
    /// A whole number.
    Whole,
    /// Three axes.
    Axes,
    /// A number, and up to two coefficients of higher order that are zero.
    Linear,
}

const FLAG: Kind = Kind::One(&["true", "false"]);
const THREE_WAYS: Kind = Kind::One(&["true", "false", "auto"]);
const NUMBER: Kind = Kind::Numbers(1, 1);
const VECTOR: Kind = Kind::Numbers(3, 3);
const JOINTS: &[&str] = &["free", "ball", "slide", "hinge"];
const GEOMS: &[&str] = &[
    "plane",
    "hfield",
    "sphere",
    "capsule",
    "ellipsoid",
    "cylinder",
    "box",
    "mesh",
    "sdf",
];

/// Elements of `<actuator>` that are read.
pub(super) const DRIVES: [&str; 4] = ["motor", "position", "velocity", "general"];
/// What attributes of an element of `<actuator>` are of.
pub(super) const DRIVE: &str = "actuator";

/// What an element of `<actuator>`, or of a class, is to [`read`].
pub(super) fn kind(tag: &str) -> &str {
    match DRIVES.contains(&tag) {
        true => DRIVE,
        false => tag,
    }
}

/// What an attribute that is read is, by the element; a joint of `<equality>` is `coupling`, an element of `<actuator>` `actuator`. None if it isn't read.
pub(super) fn read(element: &str, name: &str) -> Option<Kind> {
    let placed = matches!(element, "body" | "frame" | "inertial" | "geom" | "site");
    Some(match (element, name) {
        ("mujoco", "model") | ("default", "class") => Kind::Text,
        ("compiler", "angle") => Kind::One(&["degree", "radian"]),
        ("compiler", "coordinate") => Kind::One(&["local"]),
        ("compiler", "eulerseq") => Kind::Axes,
        ("compiler", "inertiafromgeom") => THREE_WAYS,
        ("compiler", "autolimits" | "strippath") => FLAG,
        ("compiler", "meshdir" | "assetdir") => Kind::Text,
        ("compiler", "boundmass" | "boundinertia" | "settotalmass") => NUMBER,
        ("mesh", "name" | "file" | "class") => Kind::Text,
        ("mesh", "scale" | "refpos") => VECTOR,
        ("mesh", "refquat") => Kind::Numbers(4, 4),
        ("body" | "frame", "name" | "childclass") | ("worldbody", "childclass") => Kind::Text,
        ("body", "mocap") => FLAG,
        ("body", "gravcomp") => NUMBER,
        ("inertial", "mass") => NUMBER,
        ("inertial", "diaginertia") => VECTOR,
        ("inertial", "fullinertia") => Kind::Numbers(6, 6),
        ("joint", "name" | "class") | ("freejoint", "name") => Kind::Text,
        ("joint", "type") => Kind::One(JOINTS),
        ("joint", "limited") => THREE_WAYS,
        ("joint", "pos" | "axis") => VECTOR,
        ("joint", "range" | "springdamper") => Kind::Numbers(2, 2),
        ("joint", "stiffness" | "damping") => Kind::Linear,
        ("joint", "springref" | "armature" | "frictionloss" | "ref") => NUMBER,
        ("geom", "name" | "class" | "mesh") => Kind::Text,
        ("geom", "type") => Kind::One(GEOMS),
        ("geom", "size") => Kind::Numbers(1, 3),
        ("geom", "mass" | "density") => NUMBER,
        ("geom", "contype" | "conaffinity") => Kind::Whole,
        ("site", "name" | "class") => Kind::Text,
        ("geom" | "site", "fromto") => Kind::Numbers(6, 6),
        ("coupling", "name" | "class" | "joint1" | "joint2") => Kind::Text,
        ("coupling", "polycoef") => Kind::Numbers(1, 5),
        ("coupling" | "equality", "active") => FLAG,
        (DRIVE, "name" | "class" | "joint" | "jointinparent" | "tendon" | "site") => Kind::Text,
        (DRIVE, "kp" | "kv") => NUMBER,
        (DRIVE, "gear") => Kind::Numbers(1, 6),
        (DRIVE, "gaintype" | "biastype" | "dyntype") => Kind::Text,
        (DRIVE, "gainprm" | "biasprm") => Kind::Numbers(1, 10),
        (_, "pos" | "zaxis" | "euler") if placed => VECTOR,
        (_, "quat" | "axisangle") if placed => Kind::Numbers(4, 4),
        (_, "xyaxes") if placed => Kind::Numbers(6, 6),
        _ => return None,
    })
}

/// Whether MJCF has an attribute that isn't read.
fn known(element: &str, name: &str) -> bool {
    let all: &[&str] = match element {
        "compiler" => &[
            "alignfree",
            "balanceinertia",
            "convexhull",
            "discardvisual",
            "exactmeshinertia",
            "fitaabb",
            "fusestatic",
            "inertiagrouprange",
            "saveinertial",
            "texturedir",
            "usethread",
        ],
        "mesh" => &[
            "builtin",
            "content_type",
            "face",
            "inertia",
            "material",
            "maxhullvert",
            "normal",
            "params",
            "smoothnormal",
            "texcoord",
            "vertex",
        ],
        "body" => &["sleep", "user"],
        "joint" => &[
            "actuatorfrclimited",
            "actuatorfrcrange",
            "actuatorgravcomp",
            "group",
            "margin",
            "solimpfriction",
            "solimplimit",
            "solreffriction",
            "solreflimit",
            "user",
        ],
        "freejoint" => &["align", "group"],
        "geom" => &[
            "condim",
            "fitscale",
            "fluidcoef",
            "fluidshape",
            "friction",
            "gap",
            "group",
            "hfield",
            "margin",
            "material",
            "priority",
            "rgba",
            "shellinertia",
            "solimp",
            "solmix",
            "solref",
            "user",
        ],
        "site" => &["group", "material", "rgba", "size", "type", "user"],
        "coupling" | "equality" => &["solimp", "solref"],
        DRIVE => &[
            "actdim",
            "actearly",
            "actlimited",
            "actrange",
            "body",
            "cranklength",
            "cranksite",
            "ctrllimited",
            "ctrlrange",
            "dampratio",
            "delay",
            "dynprm",
            "forcelimited",
            "forcerange",
            "group",
            "inheritrange",
            "interp",
            "lengthrange",
            "nsample",
            "refsite",
            "slidersite",
            "timeconst",
            "user",
        ],
        _ => &[],
    };
    all.contains(&name)
}

/// Attributes that change masses, and aren't read.
const OF_MASSES: [(&str, &str); 4] = [
    ("compiler", "inertiagrouprange"),
    ("compiler", "balanceinertia"),
    ("geom", "shellinertia"),
    ("mesh", "inertia"),
];

/// How an attribute that isn't read is told.
pub(super) fn unread(element: &str, tag: &str, name: &str) -> String {
    let why = match (OF_MASSES.contains(&(element, name)), known(element, name)) {
        (true, _) => ", which tells of masses",
        (_, true) => "",
        _ => ", which isn't one of its attributes",
    };
    format!("{name} of <{tag}>{why}")
}

/// The numbers of an attribute, or none if it isn't so many that are finite.
pub(super) fn numbers(value: &str) -> Option<Vec<f64>> {
    let each = value.split_ascii_whitespace().map(|word| word.parse().ok());
    let all: Vec<f64> = each.collect::<Option<_>>()?;
    all.iter().all(|x| x.abs() <= LARGEST).then_some(all)
}

/// Refuses values that can't be; `of` is the body or class that the element is in.
///
/// # Errors
/// With file, line, element, attribute and value.
pub(super) fn check(element: &Element, kind: &str, of: &str) -> Result<()> {
    let turns = TURNS.iter().filter(|name| element.get(name).is_some());
    let turns: Vec<&str> = turns.copied().collect();
    if let [one, other, ..] = turns[..] {
        let what = format!("{one} and {other} both turn it; leave one");
        return Err(element.wrong_of(of, what));
    }
    for (name, value) in &element.attributes {
        if let Some(right) = read(kind, name).and_then(|kind| lacks(kind, name, value)) {
            let what = format!("{name} = {value:?} must be {right}");
            return Err(element.wrong_of(of, what));
        }
    }
    Ok(())
}

/// What a value must be, if it isn't that.
fn lacks(kind: Kind, name: &str, value: &str) -> Option<String> {
    match kind {
        Kind::Text => None,
        Kind::One(words) => (!words.contains(&value)).then(|| match words {
            [one] => format!("{one:?}"),
            _ => format!("one of {}", words.join(", ")),
        }),
        Kind::Whole => {
            let right = value.trim().parse::<i64>().is_ok();
            (!right).then(|| "a whole number".into())
        }
        Kind::Axes => {
            let right = value.len() == 3 && value.chars().all(|c| "xyzXYZ".contains(c));
            (!right).then(|| "three of x, y, z, X, Y and Z, such as \"xyz\"".into())
        }
        Kind::Linear => match numbers(value).as_deref() {
            Some([_, higher @ ..]) if higher.len() <= 2 => {
                let curved = higher.iter().any(|x| *x != 0.0);
                curved.then(|| {
                    "one number, or zero after the first, as only the linear coefficient is read"
                        .into()
                })
            }
            _ => Some(numbers_asked([1; 2], value)),
        },
        Kind::Numbers(fewest, most) => {
            let found = numbers(value);
            let right = (found.as_ref()).is_some_and(|all| (fewest..=most).contains(&all.len()));
            let Some(all) = found.filter(|_| right) else {
                return Some(numbers_asked([fewest, most], value));
            };
            let zero = |part: &[f64]| part.iter().all(|x| *x == 0.0);
            match name {
                "quat" if zero(&all) => Some("a quaternion that isn't zero".into()),
                "axisangle" if zero(&all[..3]) => {
                    Some("an axis that isn't zero, and an angle".into())
                }
                "zaxis" if zero(&all) => Some("a direction that isn't zero".into()),
                "xyaxes" if !across(&all) => Some("two axes that aren't along one line".into()),
                _ => None,
            }
        }
    }
}

/// Whether six numbers are two directions that aren't along one line.
fn across(six: &[f64]) -> bool {
    let [x, y] = [&six[..3], &six[3..]].map(nalgebra::Vector3::from_column_slice);
    x.cross(&y).norm() > 1e-9 * x.norm() * y.norm()
}
