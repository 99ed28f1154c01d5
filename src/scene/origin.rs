//! Where in a scene file bodies are given, for messages.

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

/// The file that a body was read from and the lines of its surfaces there; empty for a body made otherwise. It says nothing of the body: any
/// two are equal.
#[derive(Clone, Debug, Default)]
pub struct Origin(Option<Arc<Lines>>);

#[derive(Debug)]
struct Lines {
    file: PathBuf,
    shape: usize,
    pieces: Vec<usize>,
}

impl PartialEq for Origin {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// Before what is said of a surface: `scene.toml, line 12: `, or nothing.
pub(crate) struct Before(Option<String>);

impl fmt::Display for Before {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Some(place) => write!(f, "{place}: "),
            None => Ok(()),
        }
    }
}

impl Origin {
    /// Of a body in `file`, with the lines of its shape and of the shapes of its pieces for contact.
    pub(super) fn new(file: PathBuf, shape: usize, pieces: Vec<usize>) -> Self {
        Self(Some(Arc::new(Lines {
            file,
            shape,
            pieces,
        })))
    }

    /// Where its shape is given, or that of a piece for contact.
    pub(crate) fn surface(&self, piece: Option<usize>) -> Before {
        let place = self.0.as_ref().map(|lines| {
            let line = match piece {
                Some(k) => lines.pieces.get(k).copied().unwrap_or(lines.shape),
                None => lines.shape,
            };
            format!("{}, line {line}", lines.file.display())
        });
        Before(place)
    }
}
