//! The machine and the day, for the record.

use std::time::{SystemTime, UNIX_EPOCH};

/// Processor, threads, memory, system, and how many tasks compete for the processor now (the mean of the last minute), in one line.
/// Says "unknown processor" where the system does not tell as Linux does.
pub fn describe() -> String {
    let first = |file: &str, key: &str| {
        let text = std::fs::read_to_string(file).unwrap_or_default();
        let value = text.lines().find(|line| line.starts_with(key)).and_then(|line| line.split_once(':'));
        value.map(|(_, value)| value.trim().to_owned())
    };
    let processor = first("/proc/cpuinfo", "model name").unwrap_or_else(|| "unknown processor".into());
    let threads = std::thread::available_parallelism().map_or(0, std::num::NonZero::get);
    let kib =
        first("/proc/meminfo", "MemTotal").and_then(|value| value.split(' ').next()?.parse::<f64>().ok());
    let memory = kib.map(|kib| format!(", {:.0} GiB", kib / 1048576.0)).unwrap_or_default();
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let load = load.split(' ').next().filter(|n| !n.is_empty()).map(|n| format!(", load {n} at the start"));
    let (system, kind) = (std::env::consts::OS, std::env::consts::ARCH);
    format!("{processor}, {threads} threads{memory}, {system} {kind}{}", load.unwrap_or_default())
}

/// Today in UTC as `[year, month, day]`.
pub fn today() -> [i64; 3] {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    date((since.as_secs() / 86_400) as i64)
}

/// The Gregorian date so many days after 1970-01-01. Years begin in March here, so that the leap day is a year's last.
fn date(days: i64) -> [i64; 3] {
    // Days since 0000-03-01; an era is 400 years.
    let days = days + 719_468;
    let (era, day) = (days.div_euclid(146_097), days.rem_euclid(146_097));
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let of_year = day - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let of_month = of_year - (153 * month + 2) / 5 + 1;
    let january = month >= 10;
    [year + 400 * era + i64::from(january), if january { month - 9 } else { month + 3 }, of_month]
}

#[cfg(test)]
mod tests {
    use super::date;

    #[test]
    fn days_are_dates_also_round_leap_days() {
        for (days, expected) in [
            (0, [1970, 1, 1]),
            (58, [1970, 2, 28]),
            (59, [1970, 3, 1]),
            (11_016, [2000, 2, 29]),
            (11_017, [2000, 3, 1]),
            (20_781, [2026, 11, 24]),
            (47_541, [2100, 3, 1]),
            (47_540, [2100, 2, 28]),
        ] {
            assert_eq!(date(days), expected, "{days}");
        }
    }
}
