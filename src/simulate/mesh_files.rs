//! What stood in the files of a scene's meshes: it is the same scene wherever they stand, and another one once they are edited.

use crate::scene::Scene;
use crate::{Error, Result};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

/// Digests of the files, in the order of bodies and of their pieces for contact; none of one that nobody could read.
#[derive(Clone, Debug)]
pub(super) struct MeshFiles(Vec<Option<String>>);

impl MeshFiles {
    /// Of a scene as its simulator is made: later they may be edited, or gone.
    pub fn of(scene: &Scene) -> Self {
        Self(scene.mesh_paths().map(|path| digest(path).ok()).collect())
    }

    /// Puts digests in place of the paths of the same scene.
    ///
    /// # Errors
    /// A file that can't be read, now as then.
    pub fn put_into(&self, scene: &mut Scene) -> Result<()> {
        for (path, known) in scene.mesh_paths_mut().zip(&self.0) {
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
    Ok(format!("{:x}", Sha256::digest(&bytes)))
}
