//! Memory that is there to be used: what would take more is refused before it is taken, since a system that has given out all of it ends the program.

use crate::{Error, Result};
use sysinfo::{MemoryRefreshKind, ProcessRefreshKind, ProcessesToUpdate, RefreshKind, System};

/// Part of what is free that one computation may take: something is left for what goes on beside it.
const PART: f64 = 0.9;
/// What is never worth a question, bytes.
const SMALL: f64 = 64e6;

/// Addresses that the allocator takes for a thread before it is asked, bytes.
#[cfg(unix)]
const ARENA: f64 = 64e6;

/// Bytes of so many numbers in double precision.
pub(crate) fn numbers(count: f64) -> f64 {
    8.0 * count
}

/// Refuses `what`, which would take so many `bytes` at once, where they aren't free; with what to do `instead`.
pub(crate) fn fits(what: &str, bytes: f64, instead: &str) -> Result<()> {
    if bytes < SMALL {
        return Ok(());
    }
    within(what, bytes, PART * free(), instead)?;
    match given(bytes) {
        true => Ok(()),
        false => Err(refused(what, bytes, "the allocator gives less", instead)),
    }
}

fn within(what: &str, bytes: f64, free: f64, instead: &str) -> Result<()> {
    match bytes <= free {
        true => Ok(()),
        false => {
            let less = format!("{free:.3e} may be used here");
            Err(refused(what, bytes, &less, instead))
        }
    }
}

fn refused(what: &str, bytes: f64, less: &str, instead: &str) -> Error {
    Error::Unsupported {
        what: what.into(),
        why: format!("it would take {bytes:.3e} bytes of memory, and {less}"),
        instead: instead.into(),
    }
}

/// Whether the allocator gives so many at once; they are given back untouched.
fn given(bytes: f64) -> bool {
    let mut asked: Vec<u8> = Vec::new();
    let given = asked.try_reserve_exact(bytes as usize).is_ok();
    // Nobody reads it: without this the compiler may leave the question out.
    std::hint::black_box(&asked);
    given
}

/// Bytes that this process can still have: of the machine, of the group that it runs in, and by its own limit; infinite where the system doesn't tell.
fn free() -> f64 {
    let memory = MemoryRefreshKind::nothing().with_ram();
    let mut system = System::new_with_specifics(RefreshKind::nothing().with_memory(memory));
    let known = |bytes: u64| match bytes {
        0 => f64::INFINITY,
        bytes => bytes as f64,
    };
    let machine = known(system.available_memory());
    // What a group keeps of files that it has read or written it gives back when it is asked: that isn't taken.
    let group = system.cgroup_limits().map_or(f64::INFINITY, |limits| {
        (known(limits.total_memory) - limits.rss as f64).max(0.0)
    });
    machine.min(group).min(own_limit(&mut system))
}

/// What the limit of this process's addresses leaves.
#[cfg(unix)]
fn own_limit(system: &mut System) -> f64 {
    let limit = match rlimit::Resource::AS.get_soft() {
        Ok(limit) if limit < rlimit::INFINITY => limit as f64,
        _ => return f64::INFINITY,
    };
    let Ok(own) = sysinfo::get_current_pid() else {
        return f64::INFINITY;
    };
    let memory = ProcessRefreshKind::nothing().with_memory();
    system.refresh_processes_specifics(ProcessesToUpdate::Some(&[own]), false, memory);
    let used = system.process(own).map_or(0, |p| p.virtual_memory());
    (limit - used as f64 - ARENA).max(0.0)
}

#[cfg(not(unix))]
fn own_limit(_: &mut System) -> f64 {
    f64::INFINITY
}

#[cfg(test)]
mod tests {
    use super::{free, within};

    #[test]
    fn what_does_not_fit_is_refused_with_its_numbers() {
        assert!(free() > 1e6);
        assert!(within("a matrix", 1e9, 2e9, "").is_ok());
        let said = within("a matrix", 3e9, 2e9, "use fewer faces")
            .unwrap_err()
            .to_string();
        for part in ["a matrix", "3.000e9", "2.000e9", "use fewer faces"] {
            assert!(said.contains(part), "{said}");
        }
    }
}
