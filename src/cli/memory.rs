//! What the process takes of the machine.

/// The most memory the process ever had resident, bytes; `None` where the system does not tell.
#[cfg(target_os = "linux")]
pub fn peak_bytes() -> Option<u64> {
    parse_peak(&std::fs::read_to_string("/proc/self/status").ok()?)
}

/// The most memory the process ever had resident, bytes; `None` where the system does not tell.
#[cfg(not(target_os = "linux"))]
pub fn peak_bytes() -> Option<u64> {
    None
}

/// The memory that the process may still take, bytes: what the machine has free, or what a limit of the process or of its
/// control group leaves; `None` where the system does not tell.
pub fn available_bytes() -> Option<u64> {
    let read = |path: &str| std::fs::read_to_string(path).ok();
    let free = read("/proc/meminfo").and_then(|text| parse_free(&text));
    let used = read("/proc/self/status").and_then(|text| kilobytes(&text, "VmSize:"));
    let limit = read("/proc/self/limits").and_then(|text| parse_address_space(&text));
    let group = |name: &str| read(&format!("/sys/fs/cgroup/memory.{name}"))?.trim().parse::<u64>().ok();
    let in_group = group("max").map(|most| most.saturating_sub(group("current").unwrap_or(0)));
    let in_space = limit.map(|most| most.saturating_sub(used.unwrap_or(0)));
    [free, in_group, in_space].into_iter().flatten().min()
}

/// Free memory, and what can be swapped out for more.
fn parse_free(meminfo: &str) -> Option<u64> {
    Some(kilobytes(meminfo, "MemAvailable:")? + kilobytes(meminfo, "SwapFree:").unwrap_or(0))
}

/// The limit on address space; `None` where it is unlimited.
fn parse_address_space(limits: &str) -> Option<u64> {
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    line.split_whitespace().next()?.parse().ok()
}

fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(target_os = "linux")]
fn parse_peak(status: &str) -> Option<u64> {
    kilobytes(status, "VmHWM:")
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn the_high_water_mark_is_read() {
        assert_eq!(parse_peak("Name:\tx\nVmHWM:\t    5120 kB\nVmRSS:\t 1 kB\n"), Some(5120 * 1024));
        assert_eq!(parse_peak("Name:\tx\n"), None);
    }

    #[test]
    fn what_is_left_is_the_least_of_all_limits() {
        let meminfo = "MemTotal: 900 kB\nMemAvailable:    5 kB\nSwapFree:  2 kB\n";
        assert_eq!(parse_free(meminfo), Some(7 * 1024));
        let limits =
            |soft: &str| format!("Max cpu time  unlimited\nMax address space    {soft}   9000  bytes\n");
        assert_eq!(parse_address_space(&limits("8000")), Some(8000));
        assert_eq!(parse_address_space(&limits("unlimited")), None);
        assert!(available_bytes().expect("Linux tells") > 0);
    }

    #[test]
    fn the_high_water_mark_rises_with_use() {
        let before = peak_bytes().expect("Linux tells");
        let block = std::hint::black_box(vec![1_u8; 64 << 20]);
        assert!(peak_bytes() >= Some(before + (block.len() as u64 >> 1)));
    }
}
