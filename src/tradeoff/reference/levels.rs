//! Finer and finer levels while there is time.

use crate::Result;
use std::time::Instant;

/// How long the reference may take, and what is asked of it.
#[derive(Clone, Copy, Debug)]
pub(in crate::tradeoff) struct Limits {
    /// s
    pub seconds: f64,
    /// Finest faces per body; then time doesn't limit the resolutions.
    pub faces: Option<usize>,
    /// Steps of the scene's own length over which trajectories are compared.
    pub steps: usize,
}

/// Runs levels one after another while the next, expected to take `growth` times as long, ends in time;
/// at least `least` of them. An error ends the climb, and counts if nothing was found before.
pub(super) fn climb<L, T>(
    levels: impl IntoIterator<Item = L>,
    least: usize,
    growth: f64,
    until: Instant,
    mut run: impl FnMut(L) -> Result<T>,
) -> Result<Vec<T>> {
    let mut out = Vec::new();
    let mut last = 0.0;
    for level in levels {
        let now = Instant::now();
        let left = until.saturating_duration_since(now).as_secs_f64();
        if out.len() >= least && growth * last > left {
            break;
        }
        match run(level) {
            Ok(found) => out.push(found),
            Err(error) if out.is_empty() => return Err(error),
            Err(_) => break,
        }
        last = now.elapsed().as_secs_f64();
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;

    #[test]
    fn climbs_stop_at_the_time_and_at_errors() {
        let now = Instant::now();
        let run = |n: usize| match n {
            3 => Err(Error::input("level", n, "less")),
            n => Ok(n),
        };
        assert_eq!(climb(0..3, 1, 0.0, now, run).unwrap(), [0, 1, 2]);
        assert_eq!(climb(0..3, 2, 1e12, now, run).unwrap(), [0, 1]);
        assert_eq!(climb(0..9, 9, 1.0, now, run).unwrap(), [0, 1, 2]);
        assert!(climb(3..9, 1, 1.0, now, run).is_err());
    }
}
