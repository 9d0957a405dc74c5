//! Amounts with their units, from text to numbers; the messages say what was expected.

/// A share: a number below 1, or percent.
pub fn tolerance(text: &str) -> Result<f64, String> {
    let share = match text.strip_suffix('%') {
        Some(percent) => percent.trim().parse::<f64>().map(|percent| percent / 100.0),
        None => text.parse::<f64>(),
    };
    match share {
        Ok(share) if share > 0.0 && share < 1.0 => Ok(share),
        _ => Err("expected a share of the mean light above 0 and below 1, such as 0.01 or 1%".to_owned()),
    }
}

/// A time with its unit, in seconds.
pub fn seconds(text: &str) -> Result<f64, String> {
    const UNITS: [(&str, f64); 4] = [("ms", 0.001), ("s", 1.0), ("m", 60.0), ("h", 3600.0)];
    let read = UNITS.iter().find_map(|(unit, scale)| {
        let number = text.strip_suffix(unit)?.trim();
        Some(number.parse::<f64>().ok()? * scale)
    });
    match read {
        Some(seconds) if (0.001..1e9).contains(&seconds) => Ok(seconds),
        _ => Err("expected a time with its unit, ms, s, m or h, such as 30s".to_owned()),
    }
}

/// A size with a binary unit, in bytes.
pub fn memory_bytes(text: &str) -> Result<u64, String> {
    const UNITS: [(&str, f64); 4] = [
        ("kib", 1024.0),
        ("mib", 1024.0 * 1024.0),
        ("gib", 1024.0 * 1024.0 * 1024.0),
        ("tib", 1024.0 * 1024.0 * 1024.0 * 1024.0),
    ];
    let lower = text.to_ascii_lowercase();
    let bytes = UNITS
        .iter()
        .find_map(|(unit, factor)| Some(lower.strip_suffix(unit)?.trim().parse::<f64>().ok()? * factor));
    match bytes {
        Some(bytes) if bytes >= 1.0 && bytes < u64::MAX as f64 => Ok(bytes as u64),
        _ => Err("expected a size with its unit, KiB, MiB, GiB or TiB, such as 4GiB".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tolerance_is_a_share() {
        assert_eq!([tolerance("0.01"), tolerance("0.5%"), tolerance("2 %")], [Ok(0.01), Ok(0.005), Ok(0.02)]);
        for wrong in ["0", "1", "-0.1", "100%", "nan", "", "%", "x"] {
            assert!(tolerance(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_time_needs_a_unit() {
        let read = ["500ms", "30s", "1.5 m", "2h"].map(seconds);
        assert_eq!(read, [Ok(0.5), Ok(30.0), Ok(90.0), Ok(7200.0)]);
        for wrong in ["30", "s", "-1s", "0s", "nans", "infm", "1d", ""] {
            assert!(seconds(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn memory_needs_a_unit() {
        assert_eq!(memory_bytes("4GiB"), Ok(4 << 30));
        assert_eq!(memory_bytes("1.5 mib"), Ok(3 << 19));
        for wrong in ["4", "4GB", "GiB", "-1GiB", "0KiB", "infGiB", "nanMiB", "99999999999TiB"] {
            assert!(memory_bytes(wrong).is_err(), "{wrong}");
        }
    }
}
