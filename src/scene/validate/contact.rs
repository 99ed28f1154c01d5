//! Contact.

use super::super::Scene;
use super::finite;
use crate::{Error, Result};

pub(super) fn check(scene: &Scene) -> Result<()> {
    let Some(contact) = &scene.contact else {
        return Ok(());
    };
    let given = [
        ("stiffness", contact.stiffness, true),
        ("dissipation", Some(contact.dissipation), false),
        ("friction", Some(contact.friction), false),
        ("gap", contact.gap, false),
        ("width", contact.width, true),
        ("stiction_speed", Some(contact.stiction_speed), true),
    ];
    for (name, value, positive) in given {
        let Some(value) = value else { continue };
        let place = format!("contact.{name}");
        finite(&place, &[value])?;
        if value < 0.0 || (positive && value == 0.0) {
            let right = match positive {
                true => "must be positive",
                false => "must not be negative",
            };
            return Err(Error::input(place, value, right));
        }
    }
    Ok(())
}
