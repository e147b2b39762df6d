//! How much memory may still be taken: asked before a large allocation, so that a job too large for the machine ends with
//! a message instead of being killed.

use crate::{Error, Result};
use std::path::Path;

/// # Errors
/// `Compute` with the number needed and the number allowed, when `bytes` for `what` are more than there are.
pub fn require(bytes: u64, what: &str, help: &str) -> Result<()> {
    match available() {
        Some(allowed) if bytes > allowed => {
            let (needed, allowed) = (in_words(bytes), in_words(allowed));
            Err(Error::compute(format!("{what} need {needed} of memory; {allowed} are free"), help))
        }
        _ => Ok(()),
    }
}

/// Bytes that this process could still take; `None` where the system does not say (only Linux does).
pub fn available() -> Option<u64> {
    let free = free_of_machine(&std::fs::read_to_string("/proc/meminfo").ok()?)?;
    Some(limit_of_group().map_or(free, |limit| limit.min(free)))
}

fn free_of_machine(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// The limit of a container, by control groups of version 2 or 1.
fn limit_of_group() -> Option<u64> {
    let groups = std::fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let own = groups.lines().find_map(|line| line.strip_prefix("0::/")).unwrap_or("");
    let root = Path::new("/sys/fs/cgroup");
    let files = [root.join(own).join("memory.max"), root.join("memory.max"), root.join("memory/memory.limit_in_bytes")];
    files.iter().filter_map(|file| std::fs::read_to_string(file).ok()?.trim().parse().ok()).min()
}

fn in_words(bytes: u64) -> String {
    let gibibytes = bytes as f64 / (1u64 << 30) as f64;
    if gibibytes >= 1.0 { format!("{gibibytes:.1} GiB") } else { format!("{:.1} MiB", gibibytes * 1024.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_refused_with_both_numbers() {
        assert_eq!(free_of_machine("MemTotal:  9 kB\nMemAvailable:    2048 kB\n"), Some(2 << 20));
        assert_eq!(free_of_machine("MemTotal:  9 kB\n"), None);
        assert!(require(1, "few", "").is_ok());
        if available().is_some() {
            let message = require(1 << 60, "many samples", "").unwrap_err().to_string();
            assert!(message.starts_with("many samples need 1073741824.0 GiB of memory; "), "{message}");
        }
    }
}
