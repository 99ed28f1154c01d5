//! Motion: what it conserves, its gradients, how runs are resumed and ended, and descent on them.

mod applied;
mod balance;
mod ballast;
#[cfg(feature = "opt")]
mod control;
mod currents;
mod driven;
mod extremes;
mod films;
mod finite;
mod forward;
mod galilean;
#[cfg(feature = "opt")]
mod grasp;
mod growth;
mod identify;
mod invariants;
mod islands;
mod late;
mod loads;
mod lubrication;
mod mechanisms;
mod observables;
#[cfg(feature = "opt")]
mod optimize;
mod parts;
mod passive;
mod random;
mod rest;
mod resume;
mod rollout_gradient;
mod shapes;
#[cfg(feature = "opt")]
mod smoothing;
mod soak;
mod stiff;
mod swimmer;
mod trees;
mod vehicle;
mod waterline;

#[path = "../support/mod.rs"]
mod support;
