//! Which attributes of a URDF file's elements are read, and which they must have.

/// The attributes that are read of an element, by its parent's name and its own; none if the element isn't read.
pub(super) fn read_attributes(parent: &str, tag: &str) -> Option<&'static [&'static str]> {
    Some(match (parent, tag) {
        ("", "robot") => &["name", "version"],
        ("robot", "link") => &["name"],
        ("robot", "joint") => &["name", "type"],
        ("link", "inertial" | "visual" | "collision") => &["name"],
        ("inertial" | "visual" | "collision" | "joint", "origin") => &["xyz", "rpy", "quat_xyzw"],
        ("inertial", "mass") => &["value"],
        ("inertial", "inertia") => &["ixx", "ixy", "ixz", "iyy", "iyz", "izz"],
        ("visual" | "collision", "geometry") => &[],
        ("geometry", "box") => &["size"],
        ("geometry", "sphere") => &["radius"],
        ("geometry", "cylinder" | "capsule") => &["radius", "length"],
        ("geometry", "mesh") => &["filename", "scale"],
        ("joint", "parent" | "child") => &["link"],
        ("joint", "axis") => &["xyz"],
        ("joint", "limit") => &["lower", "upper"],
        ("joint", "dynamics") => &["damping", "friction"],
        ("joint", "mimic") => &["joint", "multiplier", "offset"],
        _ => return None,
    })
}

/// The attributes that an element must have.
pub(super) fn needed_attributes(tag: &str, version: [u32; 2]) -> &'static [&'static str] {
    match tag {
        "limit" if version >= [1, 2] => &[],
        "link" => &["name"],
        "joint" => &["name", "type"],
        "mass" => &["value"],
        "inertia" => &["ixx", "ixy", "ixz", "iyy", "iyz", "izz"],
        "box" => &["size"],
        "sphere" => &["radius"],
        "cylinder" | "capsule" => &["radius", "length"],
        "mesh" => &["filename"],
        "parent" | "child" => &["link"],
        "axis" => &["xyz"],
        "limit" => &["velocity"],
        "mimic" => &["joint"],
        _ => &[],
    }
}
