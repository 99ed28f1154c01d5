//! Colours of bodies and walls.

use crate::{Error, Result};
use gltf::json::Material;
use gltf::json::material::{AlphaMode, PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor};
use gltf::json::validation::Checked::Valid;
use std::collections::BTreeMap;

/// Colours of bodies that none was given for, in turn: those of a replay in the browser.
pub const PALETTE: [&str; 8] = [
    "#3f74b5", "#e6a23c", "#3a9d78", "#8f6bb3", "#59b4c9", "#a9714b", "#8a949c", "#b9b545",
];

/// A rigid wall, linear.
pub(super) const RIGID: [f32; 3] = [0.4, 0.4, 0.4];

/// A free surface, linear.
pub(super) const FREE: [f32; 3] = [0.1, 0.35, 0.6];

/// Bodies are seen through walls.
pub(super) const WALL_OPACITY: f32 = 0.3;

/// Neither a mirror nor chalk.
const ROUGHNESS: f32 = 0.6;

/// A colour for each body, linear red, green and blue from 0 to 1.
pub(super) fn of_bodies(
    names: &[String],
    given: &BTreeMap<String, String>,
) -> Result<Vec<[f32; 3]>> {
    if let Some(unknown) = given.keys().find(|name| !names.contains(name)) {
        let expected = format!("no body has that name; the bodies are {names:?}");
        return Err(Error::input(
            "gltf: colors",
            format!("{unknown:?}"),
            expected,
        ));
    }
    let color = |(k, name): (usize, &String)| {
        let text = given.get(name).map(String::as_str);
        let text = text.unwrap_or(PALETTE[k % PALETTE.len()]);
        linear(text).ok_or_else(|| {
            Error::input(
                format!("gltf: colors[{name:?}]"),
                format!("{text:?}"),
                "must be a colour as \"#rrggbb\", in hexadecimal digits",
            )
        })
    };
    names.iter().enumerate().map(color).collect()
}

/// Of "#rrggbb" in sRGB.
fn linear(text: &str) -> Option<[f32; 3]> {
    let digits = text.strip_prefix('#')?;
    let right = digits.len() == 6 && digits.bytes().all(|c| c.is_ascii_hexdigit());
    let number = right
        .then(|| u32::from_str_radix(digits, 16).ok())
        .flatten()?;
    let [_, r, g, b] = number.to_be_bytes();
    Some([r, g, b].map(|part| {
        let x = f64::from(part) / 255.0;
        let y = match x <= 0.04045 {
            true => x / 12.92,
            false => ((x + 0.055) / 1.055).powf(2.4),
        };
        y as f32
    }))
}

/// A surface of one colour; one that isn't opaque is seen from both sides.
pub(super) fn material(name: &str, color: [f32; 3], opacity: f32) -> Material {
    let [r, g, b] = color;
    let opaque = opacity >= 1.0;
    Material {
        alpha_mode: Valid(if opaque {
            AlphaMode::Opaque
        } else {
            AlphaMode::Blend
        }),
        double_sided: !opaque,
        name: Some(name.into()),
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_factor: PbrBaseColorFactor([r, g, b, opacity]),
            metallic_factor: StrengthFactor(0.0),
            roughness_factor: StrengthFactor(ROUGHNESS),
            ..PbrMetallicRoughness::default()
        },
        ..Material::default()
    }
}
