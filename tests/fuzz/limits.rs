//! What one input may take: memory by an allocator that counts, time by a thread that looks.

use std::alloc::{GlobalAlloc, Layout, System};
use std::io::Write;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, Once};
use std::time::{Duration, Instant};

/// Most bytes that all inputs under way may hold.
const MOST_BYTES: usize = 3_000_000_000;
/// Longest time that one may take.
const LONGEST: Duration = Duration::from_secs(60);

static HELD: AtomicUsize = AtomicUsize::new(0);
static ENDING: AtomicBool = AtomicBool::new(false);

/// An input under way.
struct Running {
    target: &'static str,
    since: Instant,
    input: Vec<u8>,
}

static RUNNING: Mutex<Vec<Running>> = Mutex::new(Vec::new());

/// The system's allocator, which ends the program where inputs take too much.
pub struct Counting;

// SAFETY: every call is handed on to the system's allocator as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.dealloc(place, layout) }
    }
}

fn count(bytes: usize) {
    let held = HELD.fetch_add(bytes, Ordering::Relaxed);
    if held.saturating_add(bytes) > MOST_BYTES && !ENDING.swap(true, Ordering::Relaxed) {
        end(&format!(
            "{held} bytes are held, and {bytes} more asked for"
        ));
    }
}

/// Where inputs that fail are written.
pub fn folder() -> PathBuf {
    let target = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let folder = target.parent().map_or(target.clone(), |t| t.join("fuzz"));
    let _ = std::fs::create_dir_all(&folder);
    folder
}

/// Ends the program, with the inputs under way written down: neither memory nor time that is gone comes back.
fn end(why: &str) -> ! {
    let mut err = std::io::stderr();
    let _ = writeln!(err, "fuzz: {why}");
    if let Ok(running) = RUNNING.try_lock() {
        for one in running.iter() {
            let file = folder().join(format!("{}-ended", one.target));
            let _ = std::fs::write(&file, &one.input);
            let _ = writeln!(
                err,
                "  {} for {:?}: {}",
                one.target,
                one.since.elapsed(),
                file.display()
            );
        }
    }
    std::process::abort();
}

/// Watches an input until it is done.
pub fn watched<T>(target: &'static str, input: &[u8], run: impl FnOnce() -> T) -> T {
    static WATCH: Once = Once::new();
    WATCH.call_once(|| {
        std::thread::spawn(|| {
            loop {
                std::thread::sleep(Duration::from_secs(1));
                let late = |r: &Running| r.since.elapsed() > LONGEST;
                if RUNNING.lock().is_ok_and(|all| all.iter().any(late)) {
                    end("an input takes more than 60 s");
                }
            }
        });
    });
    let one = Running {
        target,
        since: Instant::now(),
        input: input.to_vec(),
    };
    RUNNING.lock().unwrap().push(one);
    let out = run();
    RUNNING.lock().unwrap().retain(|r| r.target != target);
    out
}
