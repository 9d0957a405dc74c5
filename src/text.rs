//! Numbers and names as people read them, on a screen and in a page.

use std::fmt::Write as _;

/// Text out of a file, made safe for a terminal: control characters are shown, not obeyed.
pub fn printable(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        if c.is_control() && c != '\n' {
            let _ = write!(safe, "{}", c.escape_default());
        } else {
            safe.push(c);
        }
    }
    safe
}

/// 1,234,567.
pub fn count(number: u64) -> String {
    let digits = number.to_string();
    let mut grouped = String::with_capacity(digits.len() * 4 / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            grouped.push(',');
        }
        grouped.push(digit);
    }
    grouped
}

/// "1 page", "2 pages".
pub fn plural(number: u64, noun: &str) -> String {
    format!("{} {noun}{}", count(number), if number == 1 { "" } else { "s" })
}

/// 7, 312, 41,200, 1.23 million: three digits.
pub fn about(number: u64) -> String {
    match number {
        0..1_000 => number.to_string(),
        1_000..1_000_000 => {
            let step = 10_u64.pow(number.ilog10() - 2);
            count((number + step / 2) / step * step)
        }
        1_000_000..1_000_000_000 => format!("{} million", significant(number as f64 / 1e6)),
        _ => format!("{} billion", significant(number as f64 / 1e9)),
    }
}

/// 0.42 s, 12.3 s, 2:05, 1:02:05.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    match whole {
        _ if seconds < 9.995 => format!("{:.2} s", seconds.max(0.0)),
        _ if seconds < 59.95 => format!("{seconds:.1} s"),
        0..3600 => format!("{}:{:02}", whole / 60, whole % 60),
        _ => format!("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60),
    }
}

/// 512 KiB, 1.5 GiB.
pub fn bytes(bytes: u64) -> String {
    let (size, unit) = match bytes {
        0..1_048_576 => (bytes as f64 / 1024.0, "KiB"),
        1_048_576..1_073_741_824 => (bytes as f64 / 1_048_576.0, "MiB"),
        _ => (bytes as f64 / 1_073_741_824.0, "GiB"),
    };
    if size < 10.0 { format!("{size:.1} {unit}") } else { format!("{size:.0} {unit}") }
}

/// 0.034 as "3.4 %", with as many digits as say something.
pub fn percent(share: f64) -> String {
    let percent = share * 100.0;
    match percent.abs() {
        0.0 => "0 %".to_owned(),
        x if x < 0.001 => format!("{percent:.0e} %"),
        x if x < 0.1 => format!("{percent:.3} %"),
        x if x < 10.0 => format!("{percent:.1} %"),
        _ => format!("{percent:.0} %"),
    }
}

/// Three significant digits.
pub fn significant(number: f64) -> String {
    match number.abs() {
        0.0 => "0".to_owned(),
        x if x >= 100.0 => format!("{number:.0}"),
        x if x >= 10.0 => format!("{number:.1}"),
        x if x >= 1.0 => format!("{number:.2}"),
        x if x >= 0.1 => format!("{number:.3}"),
        x if x >= 0.01 => format!("{number:.4}"),
        _ => format!("{number:.2e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!([count(0), count(999), count(1000), count(1_234_567)], ["0", "999", "1,000", "1,234,567"]);
        assert_eq!([plural(1, "page"), plural(2, "page")], ["1 page", "2 pages"]);
        let durations = [0.0, 9.99, 9.999, 59.94, 59.96, 125.4, 3725.0].map(duration);
        assert_eq!(durations, ["0.00 s", "9.99 s", "10.0 s", "59.9 s", "1:00", "2:05", "1:02:05"]);
        assert_eq!(
            [0.0, 0.001234, 0.01234, 0.1234, 1.2345, 64.125, 6412.5].map(significant),
            ["0", "1.23e-3", "0.0123", "0.123", "1.23", "64.1", "6412"]
        );
        assert_eq!([bytes(512), bytes(3 << 19), bytes(4 << 30)], ["0.5 KiB", "1.5 MiB", "4.0 GiB"]);
        let shares = [0.0, 1e-6, 5e-4, 0.034, 0.99].map(percent);
        assert_eq!(shares, ["0 %", "1e-4 %", "0.050 %", "3.4 %", "99 %"]);
    }

    #[test]
    fn names_cannot_drive_the_terminal() {
        assert_eq!(printable("Wand\u{1b}[2J é"), "Wand\\u{1b}[2J é");
    }
}
