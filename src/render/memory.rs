//! Whether there is room for a film, asked before it is made.

use crate::desc::{Error, Result};
use crate::film::{Film, FilmSpec, Groups, LayerSet};

/// Fails where the film's sums do not fit into memory: better now than when
/// the system kills the program in the middle of a pass.
///
/// # Errors
/// Says what the film takes and what there is.
pub fn check_room(spec: &FilmSpec, layers: LayerSet, groups: Groups) -> Result<()> {
    let bytes = Film::bytes_for(spec, layers, groups);
    let there = most_memory().filter(|most| bytes as u64 > *most);
    // Room that the system refuses (`ulimit -v`, no overcommitting).
    let refused = || Vec::<u8>::new().try_reserve_exact(bytes).is_err();
    if there.is_none() && !refused() {
        return Ok(());
    }
    let giga = |bytes: u64| format!("{:.1} GB", bytes as f64 * 1e-9);
    let reason = there.map_or_else(
        || "which the system refuses".to_owned(),
        |most| format!("and this machine has {}", giga(most)),
    );
    let window = spec.window();
    let message = format!(
        "the film of {} × {} pixels takes {}, {reason}",
        window.width(),
        window.height(),
        giga(bytes as u64)
    );
    Err(Error::new(message).hint("render it in parts with --crop, or with fewer layers or replicas"))
}

/// The most memory that the process can ever have, with what is on disk for
/// it, where the system tells (Linux).
fn most_memory() -> Option<u64> {
    let info = std::fs::read_to_string("/proc/meminfo").ok()?;
    let kib = |name: &str| -> Option<u64> {
        info.lines().find_map(|line| line.strip_prefix(name)?.split_whitespace().next()?.parse().ok())
    };
    let machine = (kib("MemTotal:")? + kib("SwapTotal:").unwrap_or(0)) * 1024;
    // The limits of a container, as the container sees them.
    let limits = ["/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"];
    let limit = limits.iter().find_map(|file| std::fs::read_to_string(file).ok()?.trim().parse::<u64>().ok());
    Some(limit.map_or(machine, |limit| machine.min(limit)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Filter;

    #[test]
    fn small_films_fit_and_enormous_ones_do_not() {
        let check = |width, height| {
            check_room(&FilmSpec::new(width, height, Filter::Box), LayerSet::ALL, Groups::Replicas(64))
        };
        assert!(check(64, 64).is_ok());
        let error = check(1 << 20, 1 << 20).unwrap_err();
        assert!(error.message.starts_with("the film of 1048576 × 1048576 pixels takes "), "{error}");
        assert!(error.hint.is_some_and(|hint| hint.contains("--crop")));
    }
}
