//! Compressed bodies kept: in memory, and on request in a folder.
//!
//! A body is found again by a key, the digest of everything that it was made from. A file begins with a line
//! that names format, key and digest of both and the rest; a file that doesn't match (another version or body, cut short,
//! changed), isn't a plain file or is too large counts as not there and is written anew. Files are written under another name and then
//! renamed, so that a writer that is killed leaves nothing half done.

use super::ReducedBody;
use super::compress::CompressSettings;
use super::region::Region;
use crate::geometry::TriMesh;
use crate::{Error, Result};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError};

/// Changes whenever what is stored, or how it is computed, changes.
const FORMAT: &str = concat!(
    "hydrograd-compressed-body ",
    env!("CARGO_PKG_VERSION"),
    " 8"
);
/// Bodies kept in memory.
const MOST: usize = 256;
/// Largest file that is read, bytes: some times that of a thousand points with all their modes.
const LARGEST: u64 = 256 << 20;

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
        add(&mut digest, mesh);
        // Settings are plain data: they always serialise.
        digest.update(serde_json::to_vec(&(method, settings, regions)).unwrap_or_default());
        Self(digest.finalize().into())
    }

    fn hex(&self) -> String {
        hex(&self.0)
    }
}

/// Digest of a mesh, for what a one-body method depends on beside the body's own.
pub fn mesh_digest(mesh: &TriMesh) -> String {
    let mut digest = Sha256::new();
    add(&mut digest, mesh);
    hex(&digest.finalize())
}

fn add(digest: &mut Sha256, mesh: &TriMesh) {
    for x in mesh.vertices().iter().flat_map(|v| v.iter()) {
        digest.update(x.to_bits().to_le_bytes());
    }
    for i in mesh.faces().iter().flatten() {
        digest.update((*i as u64).to_le_bytes());
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// A body, and why it couldn't be kept in the folder, if it couldn't.
pub type Fetched = (Arc<ReducedBody>, Option<String>);

/// The body of `key`: from memory, else from `folder`, else from `make`; then kept in both, as far as the folder can be written.
///
/// # Errors
/// Whatever `make` reports.
pub fn fetch(
    key: Key,
    folder: Option<&Path>,
    make: impl FnOnce() -> Result<ReducedBody>,
) -> Result<Fetched> {
    let known = memory().get(&key).cloned();
    let file = folder.map(|folder| path(folder, key));
    if let (Some(body), None) = (&known, &file) {
        return Ok((body.clone(), None));
    }
    let stored = file.as_deref().and_then(|file| read(file, key));
    let stored = stored.map(Arc::new);
    let unwritten = file.filter(|_| stored.is_none());
    let body = match known.or(stored) {
        Some(body) => body,
        None => Arc::new(make()?),
    };
    let mut warning = None;
    if let (Some(folder), Some(file)) = (folder, unwritten)
        && let Err(error) = write(folder, &file, key, &body)
    {
        warning = Some(format!(
            "a compressed body isn't kept, and will be compressed again: {error}; give another folder, or make room there"
        ));
    }
    let mut memory = memory();
    if memory.len() >= MOST {
        memory.clear();
    }
    memory.insert(key, body.clone());
    Ok((body, warning))
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

fn head(key: Key, text: &[u8]) -> String {
    let mut digest = Sha256::new();
    digest.update(key.0);
    digest.update(text);
    format!(
        "{FORMAT} {} {}\n",
        key.hex(),
        Key(digest.finalize().into()).hex()
    )
}

/// What a file holds, if it is that of `key`.
fn read(path: &Path, key: Key) -> Option<ReducedBody> {
    // Opening a pipe waits for its writer, and a device has no end.
    let plain = |m: std::fs::Metadata| m.is_file() && m.len() <= LARGEST;
    if !std::fs::metadata(path).is_ok_and(plain) {
        return None;
    }
    let mut bytes = Vec::new();
    let file = File::open(path).ok()?;
    file.take(LARGEST).read_to_end(&mut bytes).ok()?;
    let end = bytes.iter().position(|b| *b == b'\n')? + 1;
    let (first, rest) = bytes.split_at(end);
    if first != head(key, rest).as_bytes() {
        return None;
    }
    serde_json::from_slice(rest).ok()
}

fn write(folder: &Path, path: &Path, key: Key, body: &ReducedBody) -> Result<()> {
    let failed = |source: std::io::Error| Error::File {
        path: path.to_path_buf(),
        action: "write",
        source,
    };
    std::fs::create_dir_all(folder).map_err(failed)?;
    let text = serde_json::to_vec(body).map_err(|e| failed(e.into()))?;
    let mut file = tempfile::NamedTempFile::new_in(folder).map_err(failed)?;
    file.write_all(head(key, &text).as_bytes())
        .map_err(failed)?;
    file.write_all(&text).map_err(failed)?;
    file.as_file().sync_all().map_err(failed)?;
    file.persist(path).map_err(|e| failed(e.error))?;
    Ok(())
}
