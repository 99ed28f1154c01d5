//! Contact.

use super::super::Scene;
use super::bounded;
use crate::Result;

pub(super) fn check(scene: &Scene) -> Result<()> {
    let Some(contact) = &scene.contact else {
        return Ok(());
    };
    let given = [
        ("stiffness", contact.stiffness, true),
        ("dissipation", Some(contact.dissipation), false),
        ("friction", Some(contact.friction), false),
        (
            "torsional_friction",
            Some(contact.torsional_friction),
            false,
        ),
        ("rolling_friction", Some(contact.rolling_friction), false),
        ("gap", contact.gap, false),
        ("width", contact.width, true),
        ("stiction_speed", Some(contact.stiction_speed), true),
    ];
    for (name, value, positive) in given {
        let Some(value) = value else { continue };
        let right = match positive {
            true => "must be positive",
            false => "must not be negative",
        };
        bounded(&format!("contact.{name}"), value, !positive, right)?;
    }
    Ok(())
}
