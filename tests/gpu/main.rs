//! The GPU against the CPU. Fails where there is no adapter: a software one does.

mod coupled;
mod fixture;
mod reduced;
