//! Numbers as text: three significant digits, `1.23e−5` where there would be
//! many zeros, and a dash for what is not a number.

use crate::study::model::Interval;

/// For a value that is not there.
pub(super) const NONE: &str = "–";

/// Three significant digits.
pub(super) fn number(v: f64) -> String {
    if !v.is_finite() {
        return NONE.into();
    }
    if v == 0.0 {
        return "0".into();
    }
    let exponent = exponent(v);
    if (-3..5).contains(&exponent) {
        let digits = usize::try_from(2 - exponent).unwrap_or(0);
        return signed(&format!("{v:.digits$}"));
    }
    format!("{}e{}", signed(&format!("{:.2}", v / 10f64.powi(exponent))), signed(&exponent.to_string()))
}

/// As `number`, in percent, with the sign of a deviation if `plus`.
pub(super) fn percent(v: f64, plus: bool) -> String {
    if !v.is_finite() {
        return NONE.into();
    }
    let sign = if plus && v > 0.0 { "+" } else { "" };
    format!("{sign}{} %", number(100.0 * v))
}

/// `low to high`, or nothing when there is no interval.
pub(super) fn range(interval: &Interval, write: impl Fn(f64) -> String) -> String {
    if !interval.low.is_finite() && !interval.high.is_finite() {
        return String::new();
    }
    format!("{} to {}", write(interval.low), write(interval.high))
}

/// Seconds as a person says them.
pub(super) fn seconds(v: f64) -> String {
    if !v.is_finite() {
        return NONE.into();
    }
    match v {
        v if v < 1.0 => format!("{} ms", number(1e3 * v)),
        v if v < 120.0 => format!("{} s", number(v)),
        v if v < 7200.0 => format!("{} min", number(v / 60.0)),
        v => format!("{} h", number(v / 3600.0)),
    }
}

/// The power of ten of the value rounded to three digits.
fn exponent(v: f64) -> i32 {
    let text = format!("{v:.2e}");
    text.rsplit('e').next().and_then(|e| e.parse().ok()).unwrap_or(0)
}

/// With a minus sign instead of a hyphen.
fn signed(text: &str) -> String {
    text.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (v, text) in [
            (0.0, "0"),
            (1.0, "1.00"),
            (0.001_234, "0.00123"),
            (9.999e-4, "0.00100"),
            (1.5e-4, "1.50e−4"),
            (-1.5e-7, "−1.50e−7"),
            (12_345.0, "12345"),
            (123_456.0, "1.23e5"),
            (f64::NAN, "–"),
        ] {
            assert_eq!(number(v), text);
        }
        assert_eq!(percent(0.0123, true), "+1.23 %");
        assert_eq!(percent(-0.5, true), "−50.0 %");
        assert_eq!(seconds(0.25), "250 ms");
        assert_eq!(seconds(300.0), "5.00 min");
        let none = Interval { value: 1.0, low: f64::NAN, high: f64::NAN };
        assert_eq!(range(&none, number), "");
    }
}
