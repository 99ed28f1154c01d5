//! What tests and benches share. Each of them uses a part of it.
#![allow(dead_code)]

pub mod two_spheres;
