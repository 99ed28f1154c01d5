//! Compressed bodies kept: in memory, and on request in a folder.
//!
//! A body is found again by a digest of everything that it was made from. A file begins with a line
//! that names format and digest of the rest; a file that doesn't match (another version, cut short,
//! changed) counts as not there and is written anew. Files are written under another name and then
//! renamed, so that a writer that is killed leaves nothing half done.

use super::ReducedBody;
use super::compress::CompressSettings;
use super::region::Region;
use crate::geometry::TriMesh;
use crate::{Error, Result};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError};

/// Changes whenever what is stored, or how it is computed, changes.
const FORMAT: &str = concat!(
    "hydrograd-compressed-body ",
    env!("CARGO_PKG_VERSION"),
    " 2"
);
/// Bodies kept in memory.
const MOST: usize = 256;

static MEMORY: LazyLock<Mutex<HashMap<Key, Arc<ReducedBody>>>> = LazyLock::new(Default::default);

/// What a compressed body was made from, in short.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Key([u8; 32]);

impl Key {
    /// Digest of a mesh in the body's frame, of what else the one-body `method` depends on, and of the
    /// compression's settings and regions.
    pub fn new(
        mesh: &TriMesh,
        method: &impl Serialize,
        settings: &CompressSettings,
        regions: &[Region],
    ) -> Self {
        let mut digest = Sha256::new();
        digest.update(FORMAT);
        for x in mesh.vertices().iter().flat_map(|v| v.iter()) {
            digest.update(x.to_bits().to_le_bytes());
        }
        for i in mesh.faces().iter().flatten() {
            digest.update((*i as u64).to_le_bytes());
        }
        // Settings are plain data: they always serialise.
        digest.update(serde_json::to_vec(&(method, settings, regions)).unwrap_or_default());
        Self(digest.finalize().into())
    }

    fn hex(&self) -> String {
        self.0.iter().map(|b| format!("{b:02x}")).collect()
    }
}

/// The body of `key`: from memory, else from `folder`, else from `make`; then kept in both.
///
/// # Errors
/// Whatever `make` reports, and a folder that can't be written.
pub fn fetch(
    key: Key,
    folder: Option<&Path>,
    make: impl FnOnce() -> Result<ReducedBody>,
) -> Result<Arc<ReducedBody>> {
    let known = memory().get(&key).cloned();
    let file = folder.map(|folder| path(folder, key));
    if let (Some(body), None) = (&known, &file) {
        return Ok(body.clone());
    }
    let stored = file.as_deref().and_then(read).map(Arc::new);
    let unwritten = file.filter(|_| stored.is_none());
    let body = match known.or(stored) {
        Some(body) => body,
        None => Arc::new(make()?),
    };
    if let (Some(folder), Some(file)) = (folder, unwritten) {
        write(folder, &file, &body)?;
    }
    let mut memory = memory();
    if memory.len() >= MOST {
        memory.clear();
    }
    memory.insert(key, body.clone());
    Ok(body)
}

fn memory() -> MutexGuard<'static, HashMap<Key, Arc<ReducedBody>>> {
    MEMORY.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Forgets the bodies kept in memory.
pub fn forget() {
    memory().clear();
}

/// The file of `key` in `folder`.
pub fn path(folder: &Path, key: Key) -> PathBuf {
    folder.join(format!("{}.body", key.hex()))
}

fn head(text: &[u8]) -> String {
    let digest: [u8; 32] = Sha256::digest(text).into();
    format!("{FORMAT} {}\n", Key(digest).hex())
}

fn read(path: &Path) -> Option<ReducedBody> {
    let bytes = std::fs::read(path).ok()?;
    let end = bytes.iter().position(|b| *b == b'\n')? + 1;
    let (first, rest) = bytes.split_at(end);
    if first != head(rest).as_bytes() {
        return None;
    }
    serde_json::from_slice(rest).ok()
}

fn write(folder: &Path, path: &Path, body: &ReducedBody) -> Result<()> {
    let failed = |source: std::io::Error| Error::File {
        path: path.to_path_buf(),
        action: "write",
        source,
    };
    std::fs::create_dir_all(folder).map_err(failed)?;
    let text = serde_json::to_vec(body).map_err(|e| failed(e.into()))?;
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(failed)?;
    file.write_all(head(&text).as_bytes()).map_err(failed)?;
    file.write_all(&text).map_err(failed)?;
    file.as_file().sync_all().map_err(failed)?;
    file.persist(path).map_err(|e| failed(e.error))?;
    Ok(())
}
