//! Members side by side on as many threads as there are cores, each on a stack of its own: one that waits for an answer makes way for the next of its
//! thread. A thread for each member would be woken for each answer, which takes far longer than what is done in between.

use corosensei::stack::DefaultStack;
use corosensei::{Coroutine, CoroutineResult, Yielder};
use std::any::Any;
use std::cell::Cell;
use std::marker::PhantomData;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::Builder;
use std::time::Duration;

/// Stack of a member, bytes; only pages that are touched take memory.
const STACK: usize = 4 << 20;

/// How often a thread of the pool looks whether others are done while it does the pool's work.
const LOOK: Duration = Duration::from_micros(200);

/// What a member tells when it makes way: whether it asked something new, or still waits.
type Moved = bool;

/// Who runs on a thread.
#[derive(Clone, Copy)]
struct Running {
    seat: usize,
    yielder: NonNull<Yielder<(), Moved>>,
}

thread_local! {
    static RUNNING: Cell<Option<Running>> = const { Cell::new(None) };
}

/// The seat of the member that runs here.
pub(super) fn seat() -> Option<usize> {
    RUNNING.get().map(|running| running.seat)
}

/// Lets other members of this thread run, and comes back after them; on a thread of no crew, waits until the thread is woken.
pub(super) fn make_way(moved: Moved) {
    let Some(running) = RUNNING.get() else {
        std::thread::park();
        return;
    };
    // SAFETY: the yielder is that of the coroutine which runs here: `RUNNING` is set on its own stack, and empty whenever no member runs on this thread.
    // It lives until the coroutine's body ends, on whose stack this is.
    unsafe { running.yielder.as_ref() }.suspend(moved);
    RUNNING.set(Some(running));
}

/// A member of a crew, which has begun or not.
struct Place<'a> {
    coroutine: Coroutine<(), Moved, ()>,
    member: PhantomData<&'a (dyn Fn(usize) + Sync)>,
}

impl<'a> Place<'a> {
    /// One that sits at `seat`, on a stack that there is.
    fn new(stack: DefaultStack, seat: usize, member: &'a (dyn Fn(usize) + Sync)) -> Self {
        let body = move |yielder: &Yielder<(), Moved>, ()| {
            let yielder = NonNull::from(yielder);
            RUNNING.set(Some(Running { seat, yielder }));
            member(seat);
        };
        // SAFETY: the body borrows `member` alone, which a place doesn't outlive, its drop included. Nothing here forgets a place.
        let coroutine = unsafe { Coroutine::with_stack_unchecked(stack, body) };
        Self {
            coroutine,
            member: PhantomData,
        }
    }
}

impl Drop for Place<'_> {
    /// Unwinds what has begun while all that it borrows is still there.
    fn drop(&mut self) {
        self.coroutine.force_unwind();
    }
}

/// Runs all of a thread's members to their ends. One that panics loses what it did; the first panic is handed on when all others are done.
fn work(mut places: Vec<Place<'_>>) -> Option<Box<dyn Any + Send>> {
    let mut panicked = None;
    while !places.is_empty() {
        let mut moved = false;
        places.retain_mut(|place| {
            let ran = catch_unwind(AssertUnwindSafe(|| place.coroutine.resume(())));
            RUNNING.set(None);
            match ran {
                Ok(CoroutineResult::Yield(asked)) => {
                    moved |= asked;
                    true
                }
                Ok(CoroutineResult::Return(())) => {
                    moved = true;
                    false
                }
                Err(why) => {
                    match panicked {
                        None => panicked = Some(why),
                        // What it holds may panic again when it is dropped.
                        Some(_) => std::mem::forget(why),
                    }
                    moved = true;
                    false
                }
            }
        });
        // Who answers wakes this thread; if that was meanwhile, it isn't stopped here.
        if !moved {
            std::thread::park();
        }
    }
    panicked
}

/// Calls `member` once for each seat, all side by side, while `servers` run beside them. Seats for which there is no thread or memory are given to `leave`
/// instead.
///
/// # Errors
/// A server that has no thread, or no thread and memory for any seat: then nobody sat down.
pub(super) fn side_by_side(
    seats: usize,
    servers: &[&(dyn Fn() + Sync)],
    member: &(dyn Fn(usize) + Sync),
    leave: &(dyn Fn(usize) + Sync),
) -> std::io::Result<()> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let workers = cores.min(seats);
    let (left, seated) = (AtomicUsize::new(workers), AtomicUsize::new(0));
    let mut panicked = None;
    let done = std::thread::scope(|scope| {
        let all = 0..seats;
        for (n, serve) in servers.iter().enumerate() {
            let made = Builder::new().name(format!("answers {n}"));
            if let Err(error) = made.spawn_scoped(scope, serve) {
                // Those that began end when nobody is present.
                all.for_each(leave);
                return Err(error);
            }
        }
        let mut lost = None;
        let mut threads = Vec::new();
        for w in 0..workers {
            // All groups of seats on each thread, so that one group is at work while another waits.
            let own = all.clone().skip(w).step_by(workers);
            let (left, seated) = (&left, &seated);
            let body = {
                let own = own.clone();
                move || {
                    let mut lost = None;
                    let mut places = Vec::new();
                    for seat in own {
                        match DefaultStack::new(STACK) {
                            Ok(stack) => places.push(Place::new(stack, seat, member)),
                            Err(error) => {
                                lost = Some(error);
                                leave(seat);
                            }
                        }
                    }
                    seated.fetch_add(places.len(), Ordering::Relaxed);
                    let panicked = work(places);
                    left.fetch_sub(1, Ordering::Release);
                    (lost, panicked)
                }
            };
            let named = Builder::new().name(format!("members {w}"));
            match named.spawn_scoped(scope, body) {
                Ok(thread) => threads.push(thread),
                Err(error) => {
                    // Nobody may wait for a seat that stays empty; those that are taken do all the work.
                    own.for_each(leave);
                    left.fetch_sub(1, Ordering::Release);
                    lost = Some(error);
                }
            }
        }
        // A thread of the pool must not wait for others that may need the pool.
        while rayon::current_thread_index().is_some() && left.load(Ordering::Acquire) > 0 {
            if rayon::yield_now() != Some(rayon::Yield::Executed) {
                std::thread::sleep(LOOK);
            }
        }
        for thread in threads {
            match thread.join() {
                Ok((failed, why)) => {
                    lost = lost.take().or(failed);
                    panicked = panicked.take().or(why);
                }
                Err(why) => panicked = Some(why),
            }
        }
        match lost {
            Some(error) if seated.load(Ordering::Relaxed) == 0 => Err(error),
            _ => Ok(()),
        }
    });
    match panicked {
        Some(why) => resume_unwind(why),
        None => done,
    }
}

#[cfg(test)]
mod tests {
    use super::{make_way, seat, side_by_side};
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// Members of one thread take turns, and each knows its seat after others have run.
    #[test]
    fn members_take_turns() {
        let seen = Mutex::new(vec![0; 100]);
        let member = |own: usize| {
            for turn in 0..own % 7 {
                assert_eq!(seat(), Some(own));
                seen.lock().unwrap()[own] += turn + 1;
                make_way(true);
            }
        };
        side_by_side(100, &[], &member, &|_| panic!("nobody is left out")).unwrap();
        assert!(seat().is_none());
        let seen = seen.into_inner().unwrap();
        assert!((0..100).all(|own| seen[own] == (own % 7) * (own % 7 + 1) / 2));
    }

    /// One that panics doesn't keep the others from their ends.
    #[test]
    fn a_panic_comes_out_when_all_are_done() {
        let ended = AtomicUsize::new(0);
        let member = |own: usize| {
            make_way(true);
            assert_ne!(own, 3, "on purpose");
            make_way(true);
            ended.fetch_add(1, Ordering::Relaxed);
        };
        let ran = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            side_by_side(10, &[], &member, &|_| ())
        }));
        assert!(ran.is_err());
        assert_eq!(ended.load(Ordering::Relaxed), 9);
    }
}
