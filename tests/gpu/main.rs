//! The GPU against the CPU. Fails where there is no adapter: a software one does.

mod batch;
#[cfg(feature = "cli")]
mod cli;
mod counters;
mod coupled;
mod fixture;
mod kernels;
mod large;
mod panels;
mod reduced;
mod refined;
mod robust;
mod scattered;
mod trajectory;

#[path = "../support/mod.rs"]
mod support;

use hydrograd::gpu::source::SHADERS;
use std::collections::BTreeSet;

macro_rules! comparisons {
    ($($shader:literal => $check:path,)*) => {
        /// What compares each shader with the CPU.
        const COMPARISONS: &[(&str, fn())] = &[$(($shader, $check),)*];
    };
}

comparisons! {
    "apply" => kernels::products,
    "apply_jvp" => kernels::products,
    "apply_transpose" => kernels::products,
    "apply_transpose_jvp" => kernels::products,
    "batch_pull" => batch::rungs,
    "batch_solve" => batch::rungs,
    "batch_tangent" => batch::rungs,
    "blocks" => reduced::rungs,
    "cgls" => kernels::solves,
    "combine" => coupled::combinations,
    "conjugate" => reduced::rungs,
    "coulomb" => reduced::rungs,
    "coulomb_hvp" => reduced::rungs,
    "coulomb_jvp" => reduced::rungs,
    "coulomb_vjp" => reduced::rungs,
    "diagonal" => kernels::solves,
    "factor" => kernels::solves,
    "gmres" => panels::solves,
    "impulse" => coupled::combinations,
    "pair_hvp" => kernels::derivatives,
    "pair_vjp" => kernels::derivatives,
    "panel_hvp" => panels::derivatives,
    "panel_vjp" => panels::derivatives,
    "place" => kernels::products,
    "products" => coupled::combinations,
    "reduce" => kernels::derivatives,
    "refine" => kernels::solves,
    "rows" => coupled::combinations,
    "sparse" => kernels::solves,
    "sum" => kernels::products,
    "wrench" => reduced::rungs,
}

#[test]
fn every_shader_gives_what_its_twin_does() {
    let known: BTreeSet<&str> = SHADERS.iter().map(|s| s.name).collect();
    let compared: BTreeSet<&str> = COMPARISONS.iter().map(|(name, _)| *name).collect();
    assert_eq!(known, compared);
    let mut done: Vec<fn()> = Vec::new();
    for (_, check) in COMPARISONS {
        if !done.iter().any(|d| std::ptr::fn_addr_eq(*d, *check)) {
            check();
            done.push(*check);
        }
    }
}
