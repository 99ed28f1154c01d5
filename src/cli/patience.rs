//! A word on standard error where work takes long and nothing else tells of it.

use std::io::Write;
use std::sync::mpsc::{Sender, channel};
use std::thread::{JoinHandle, spawn};
use std::time::{Duration, Instant};

/// When the first word is said; each further one after twice the time.
const FIRST: Duration = Duration::from_secs(10);

/// Tells that the work goes on, for as long as it is held.
pub(super) struct Patience {
    work: Option<(Sender<()>, JoinHandle<()>)>,
}

impl Patience {
    /// While `what` goes on.
    pub fn with(what: String) -> Self {
        Self::saying(FIRST, move |passed| {
            let _ = writeln!(
                std::io::stderr(),
                "hydrograd: still {what} after {:.0} s",
                passed.as_secs_f64()
            );
        })
    }

    fn saying(first: Duration, say: impl Fn(Duration) + Send + 'static) -> Self {
        let (done, waits) = channel();
        let words = move || {
            let start = Instant::now();
            let mut next = first;
            while let Err(std::sync::mpsc::RecvTimeoutError::Timeout) =
                waits.recv_timeout(next.saturating_sub(start.elapsed()))
            {
                say(start.elapsed());
                next *= 2;
            }
        };
        Self {
            work: Some((done, spawn(words))),
        }
    }
}

impl Drop for Patience {
    fn drop(&mut self) {
        if let Some((done, words)) = self.work.take() {
            drop(done);
            let _ = words.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn says_a_word_after_a_while_and_none_once_it_is_dropped() {
        let said = Arc::new(AtomicUsize::new(0));
        let patience = |first: u64| {
            let said = said.clone();
            Patience::saying(Duration::from_millis(first), move |_| {
                said.fetch_add(1, Ordering::Relaxed);
            })
        };
        drop(patience(60_000));
        assert_eq!(said.load(Ordering::Relaxed), 0);
        let held = patience(1);
        while said.load(Ordering::Relaxed) < 3 {
            std::thread::yield_now();
        }
        drop(held);
        let words = said.load(Ordering::Relaxed);
        std::thread::sleep(Duration::from_millis(20));
        assert_eq!(said.load(Ordering::Relaxed), words);
    }
}
