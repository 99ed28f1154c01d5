//! A body of a scene, as a user names it.

use super::Rollout;
use crate::scene::BodyId;
use crate::{Error, Result};

/// A body of the scene, by its number or its name.
#[derive(Clone, Debug, PartialEq)]
pub enum Which {
    /// Its number, from 0.
    Number(usize),
    /// Its name.
    Named(String),
}

impl From<BodyId> for Which {
    fn from(body: BodyId) -> Self {
        Self::Number(body.0)
    }
}

impl From<&str> for Which {
    fn from(name: &str) -> Self {
        Self::Named(name.into())
    }
}

impl From<String> for Which {
    fn from(name: String) -> Self {
        Self::Named(name)
    }
}

impl Which {
    /// Its number; none where the scene has no such body.
    pub(super) fn number(&self, rollout: &Rollout) -> Option<usize> {
        let bodies = &rollout.simulator().system().bodies;
        match self {
            Self::Number(body) => (*body < bodies.len()).then_some(*body),
            Self::Named(name) => bodies.iter().position(|b| b.name == *name),
        }
    }

    /// Its number; `what` asks for it.
    ///
    /// # Errors
    /// A body that there isn't.
    pub(super) fn found(&self, what: &str, rollout: &Rollout) -> Result<usize> {
        self.number(rollout).ok_or_else(|| {
            let bodies = &rollout.simulator().system().bodies;
            let place = format!("{what}: body");
            match self {
                Self::Number(body) => {
                    let expected =
                        format!("must be under {}, the scene's number of them", bodies.len());
                    Error::input(place, body, expected)
                }
                Self::Named(name) => {
                    let names: Vec<&str> = bodies.iter().map(|b| b.name.as_str()).collect();
                    Error::input(
                        place,
                        format!("{name:?}"),
                        format!("must be one of {names:?}"),
                    )
                }
            }
        })
    }
}
