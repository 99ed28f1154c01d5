//! Mesh files: OBJ, STL (text and binary) and PLY (text and binary), told apart by extension.
//!
//! Whatever is in the file, the answer is a mesh or an error with the path, never a panic.

mod obj;
mod ply;
mod polygon;
mod raw;
mod read;
mod repair;
mod stl;

pub use obj::write_obj;
pub use raw::Repairs;
pub use read::{FileMesh, read, read_unchecked};
