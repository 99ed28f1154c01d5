//! The methods by which a body alone is solved, as one list.

use crate::boundary::{self, OneBody};
use crate::simulate::{Fidelity, Settings};
use serde::{Deserialize, Serialize};

/// How a body alone is solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// [`OneBody::Auto`].
    Auto,
    /// [`OneBody::Exact`].
    Exact,
    /// [`OneBody::Panel`].
    Panel,
    /// [`boundary::Method::MfsVertex`].
    MfsVertex,
    /// [`boundary::Method::MfsFace`].
    MfsFace,
}

impl Method {
    /// Puts the method into the settings.
    pub fn choose(self, settings: Settings) -> Settings {
        match self {
            Method::Auto => settings.one_body(OneBody::Auto),
            Method::Exact => settings.one_body(OneBody::Exact),
            Method::Panel => settings.one_body(OneBody::Panel),
            Method::MfsVertex => settings.method(boundary::Method::MfsVertex),
            Method::MfsFace => settings.method(boundary::Method::MfsFace),
        }
    }

    /// What settings use.
    pub(super) fn of(settings: &Settings) -> Self {
        match (settings.one_body, settings.boundary.method) {
            (OneBody::Auto, _) if settings.fidelity != Fidelity::Full => Method::Auto,
            (OneBody::Exact, _) => Method::Exact,
            (OneBody::Panel, _) => Method::Panel,
            (_, boundary::Method::MfsVertex) => Method::MfsVertex,
            (_, boundary::Method::MfsFace) => Method::MfsFace,
        }
    }
}
