//! An allocator that gives nothing large: whatever takes much memory asks for it first and says what doesn't fit, so that the program isn't ended.
//!
//! What isn't asked for ends these tests with "memory allocation of … bytes failed".

use hydrograd::scene::{Body, Fluid, Scene, Shape};
use hydrograd::simulate::{Exchange, Method, Variables};
use hydrograd::{Controls, Fidelity, Result, Settings, Simulator};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Largest piece that is given, bytes.
static MOST: AtomicUsize = AtomicUsize::new(usize::MAX);

struct Stingy;

fn too_large(bytes: usize) -> bool {
    bytes > MOST.load(Ordering::Relaxed)
}

// SAFETY: the system's allocator, or none at all.
unsafe impl GlobalAlloc for Stingy {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if too_large(layout.size()) {
            return std::ptr::null_mut();
        }
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if too_large(layout.size()) {
            return std::ptr::null_mut();
        }
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, old: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        if too_large(size) {
            return std::ptr::null_mut();
        }
        unsafe { System.realloc(old, layout, size) }
    }

    unsafe fn dealloc(&self, old: *mut u8, layout: Layout) {
        unsafe { System.dealloc(old, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Stingy = Stingy;

/// So many cubes in a row.
fn blocks(count: usize, faces: usize) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    for i in 0..count {
        let cube = Body::new(Shape::cuboid([0.2; 3]).faces(faces)).density(1200.0);
        scene.add(cube.at([0.5 * i as f64, 0.0, 0.0]));
    }
    scene
}

fn simulator(scene: &Scene, fidelity: Fidelity) -> Result<Simulator> {
    Simulator::new(scene, Settings::default().fidelity(fidelity))
}

fn by_fundamental_solutions(fidelity: Fidelity, faces: usize) -> Result<()> {
    let settings = Settings::default().fidelity(fidelity);
    Simulator::new(&blocks(2, faces), settings.method(Method::MfsFace)).map(drop)
}

type Work = Box<dyn Fn() -> Result<()>>;

/// What takes more than 64 MB at once, by name.
fn hungry() -> Vec<(&'static str, Work)> {
    vec![
        (
            "a body by panels",
            Box::new(|| simulator(&blocks(1, 4000), Fidelity::Isolated).map(drop)),
        ),
        (
            "a body by fundamental solutions",
            Box::new(|| by_fundamental_solutions(Fidelity::Isolated, 4000)),
        ),
        (
            "bodies coupled by panels",
            Box::new(|| simulator(&blocks(3, 1280), Fidelity::Full).map(drop)),
        ),
        (
            "bodies coupled by fundamental solutions",
            Box::new(|| by_fundamental_solutions(Fidelity::Full, 2000)),
        ),
        (
            "many bodies coupled by a factor",
            Box::new(|| {
                let settings = Settings::default().fidelity(Fidelity::Reduced);
                Simulator::new(&blocks(400, 20), settings.exchange(Exchange::Factor)).map(drop)
            }),
        ),
        (
            "a long run",
            Box::new(|| {
                let simulator = simulator(&blocks(1, 80), Fidelity::Isolated)?;
                simulator
                    .rollout(&Controls::zeros(&simulator, 400_000))
                    .map(drop)
            }),
        ),
        (
            "a wide Jacobian",
            Box::new(|| {
                let simulator = simulator(&blocks(60, 80), Fidelity::Isolated)?;
                let rollout = simulator.rollout(&Controls::zeros(&simulator, 1000))?;
                let variables = Variables {
                    initial_q: true,
                    initial_v: true,
                    ..Variables::default()
                };
                let states: Vec<usize> = (0..=1000).collect();
                let jacobian = rollout.jacobian(&variables, &["velocities"], &states);
                jacobian.map(drop)
            }),
        ),
    ]
}

#[test]
fn what_is_not_given_is_refused() {
    for (name, work) in hungry() {
        MOST.store(64_000_000, Ordering::Relaxed);
        let done = work();
        MOST.store(usize::MAX, Ordering::Relaxed);
        let said = done.expect_err(name).to_string();
        assert!(said.contains("bytes of memory"), "{name}: {said}");
    }
}
