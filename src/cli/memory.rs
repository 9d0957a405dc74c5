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

#[cfg(target_os = "linux")]
fn parse_peak(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
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
    fn the_high_water_mark_rises_with_use() {
        let before = peak_bytes().expect("Linux tells");
        let block = std::hint::black_box(vec![1_u8; 64 << 20]);
        assert!(peak_bytes() >= Some(before + (block.len() as u64 >> 1)));
    }
}
