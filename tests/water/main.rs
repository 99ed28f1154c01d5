//! Added mass and flow: one body by each method, coupled bodies by each fidelity, against exact values.

mod analytic;
mod asked;
mod auto;
mod corners;
mod estimate;
mod exact;
mod films;
mod flow;
mod gap_check;
mod gap_error;
mod given;
mod lines;
mod long_faces;
mod methods;
mod near;
mod one_body;
mod overlap;
mod panel;
mod panel_coupled;
mod panel_films;
mod plates;
mod pressure;
mod pressure_films;
mod reduced;
mod refine;
mod scattering;
mod scattering_films;
mod scattering_scenes;
mod sensors;
mod several_pieces;
mod shape_slopes;
mod touching_edges;

#[path = "../support/mod.rs"]
mod support;
