//! How much memory there is. Systems promise more than they have and end the program that comes to use it, so whoever reads a size
//! from a file asks before.

/// Bytes that this process can still get, as far as the system says so: memory and swap that are free or can be freed, within the limit
/// of its container.
pub fn available() -> Option<u64> {
    let read = |path: &str| std::fs::read_to_string(path).ok();
    let free = of_meminfo(&read("/proc/meminfo")?)?;
    let limits = ["/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"];
    // "max" where there is no limit.
    let limit = limits.iter().find_map(|path| read(path)?.trim().parse().ok());
    Some(limit.map_or(free, |limit| free.min(limit)))
}

/// `MemAvailable` and `SwapFree` of Linux, in kB.
fn of_meminfo(text: &str) -> Option<u64> {
    let field = |name: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(name))?;
        line.trim().strip_suffix(" kB")?.parse::<u64>().ok()?.checked_mul(1024)
    };
    field("MemAvailable:")?.checked_add(field("SwapFree:").unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_that_can_be_freed_and_swap_count() {
        let text = "MemTotal:       24117248 kB\nMemFree:         1000000 kB\nMemAvailable:    2000000 kB\nSwapFree:            500 kB\n";
        assert_eq!(of_meminfo(text), Some(2_000_500 * 1024));
        assert_eq!(of_meminfo("MemAvailable: 3 kB\n"), Some(3 * 1024));
        assert_eq!(of_meminfo("MemTotal: 3 kB\n"), None);
        assert_eq!(of_meminfo("MemAvailable: 18446744073709551615 kB\n"), None);
    }
}
