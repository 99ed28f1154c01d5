//! What stood in the files of a scene's meshes: it is the same scene wherever they stand, and another one once they are edited.

use crate::scene::{Scene, Shape};
use crate::{Error, Result};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

/// Digests of the files, in the order of bodies and of their pieces for contact; none of one that nobody could read.
#[derive(Clone, Debug)]
pub(super) struct MeshFiles(Vec<Option<String>>);

impl MeshFiles {
    /// Of a scene as its simulator is made: later they may be edited, or gone.
    pub fn of(scene: &Scene) -> Self {
        let shapes = scene.bodies.iter().flat_map(|body| {
            let pieces = body.collision.iter().map(|piece| &piece.shape);
            body.shape.iter().chain(pieces)
        });
        let paths = shapes.filter_map(|shape| match shape {
            Shape::Mesh { path, .. } => Some(path),
            _ => None,
        });
        Self(paths.map(|path| digest(path).ok()).collect())
    }

    /// Puts digests in place of the paths of the same scene.
    ///
    /// # Errors
    /// A file that can't be read, now as then.
    pub fn put_into(&self, scene: &mut Scene) -> Result<()> {
        let shapes = scene.bodies.iter_mut().flat_map(|body| {
            let pieces = body.collision.iter_mut().map(|piece| &mut piece.shape);
            body.shape.iter_mut().chain(pieces)
        });
        let paths = shapes.filter_map(|shape| match shape {
            Shape::Mesh { path, .. } => Some(path),
            _ => None,
        });
        for (path, known) in paths.zip(&self.0) {
            let found = match known {
                Some(known) => known.clone(),
                None => digest(path)?,
            };
            *path = PathBuf::from(found);
        }
        Ok(())
    }
}

/// Digest of what is in a file.
fn digest(path: &Path) -> Result<String> {
    let bytes = std::fs::read(path).map_err(|source| Error::File {
        path: path.to_owned(),
        action: "read",
        source,
    })?;
    let digest = Sha256::digest(&bytes);
    Ok(digest.iter().map(|b| format!("{b:02x}")).collect())
}
