//! Actuators as what they all are: `<general>` ones, of which `<motor>`, `<position>` and `<velocity>` set some attributes, in classes of defaults too.

use super::attributes::{DRIVES, numbers};
use super::classes::Classes;
use super::element::Element;
use crate::Result;

/// Entries of `gainprm` and `biasprm` that are read.
const READ: usize = 3;

/// What force follows from a control: by `gainprm[0]`, and `biasprm` for 1, the length and its rate.
struct Law {
    types: [String; 3],
    gain: [f64; READ],
    bias: [f64; READ],
}

const TYPES: [&str; 3] = ["gaintype", "biastype", "dyntype"];

/// The first entries of a list that an attribute gives; the others stay.
fn put(list: &mut [f64; READ], element: &Element, name: &str) {
    let given = element.get(name).and_then(numbers).unwrap_or_default();
    for (entry, value) in list.iter_mut().zip(given) {
        *entry = value;
    }
}

impl Law {
    /// That of an actuator without attributes.
    fn new() -> Self {
        Self {
            types: ["fixed", "none", "none"].map(String::from),
            gain: [1.0, 0.0, 0.0],
            bias: [0.0; READ],
        }
    }

    fn set(&mut self, gain: &str, bias: &str) {
        self.types[0] = gain.into();
        self.types[1] = bias.into();
    }

    /// With what an element sets.
    fn take(&mut self, element: &Element) {
        let number = |name: &str| Some(*numbers(element.get(name)?)?.first()?);
        match &element.tag[..] {
            "general" => {
                for (kind, name) in self.types.iter_mut().zip(TYPES) {
                    if let Some(given) = element.get(name) {
                        *kind = given.into();
                    }
                }
                put(&mut self.gain, element, "gainprm");
                put(&mut self.bias, element, "biasprm");
            }
            "motor" => {
                self.set("fixed", "none");
                self.gain = [1.0, 0.0, 0.0];
            }
            "position" => {
                self.set("fixed", "affine");
                let kp = number("kp").unwrap_or(self.gain[0]);
                self.gain[0] = kp;
                self.bias[1] = -kp;
                if let Some(kv) = number("kv") {
                    self.bias[2] = -kv;
                }
            }
            "velocity" => {
                self.set("fixed", "affine");
                let kv = number("kv").unwrap_or(self.gain[0]);
                self.gain[0] = kv;
                self.bias = [0.0, 0.0, -kv];
            }
            _ => {}
        }
    }
}

/// An actuator with what its class has, as a `<general>` one; of kinds that aren't read what it says itself.
///
/// # Errors
/// A class that isn't there.
pub(super) fn general(classes: &Classes, element: &Element) -> Result<Element> {
    if !DRIVES.contains(&&element.tag[..]) {
        return Ok(element.clone());
    }
    let mut law = Law::new();
    let mut made = Element::at("general", element);
    let given = classes.given(element, None)?.into_iter();
    let given = given.filter(|e| DRIVES.contains(&&e.tag[..]));
    for from in given.chain([element]) {
        law.take(from);
        let own = std::ptr::eq(from, element);
        // Names are each element's own.
        let kept = from.attributes.iter();
        let kept = kept.filter(|(name, _)| name != "class" && (own || name != "name"));
        for (name, value) in kept {
            made.set(name, value);
        }
    }
    for (name, kind) in TYPES.iter().zip(&law.types) {
        made.set(name, kind);
    }
    for (name, list) in [("gainprm", &law.gain), ("biasprm", &law.bias)] {
        let list: Vec<String> = list.iter().map(f64::to_string).collect();
        made.set(name, &list.join(" "));
    }
    Ok(made)
}
