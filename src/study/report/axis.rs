//! An axis of a plot: range, ticks and where a value lies.
//!
//! A logarithmic axis is drawn as a linear one over log10, with ticks of our
//! own: powers of ten, of two for sample counts, 1-2-5 on short ranges.

/// An axis with a range that is never empty.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    pub(super) label: String,
    kind: Kind,
    /// In the axis' own coordinate: log10 of the value on logarithmic axes.
    pub(super) low: f64,
    pub(super) high: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Linear,
    Decades,
    Octaves,
}

/// A grid line, with text if it is a main one.
#[derive(Debug, PartialEq)]
pub(super) struct Tick {
    /// In the axis' own coordinate.
    pub(super) at: f64,
    pub(super) text: Option<String>,
}

impl Axis {
    /// Over the positive finite ones among `values`; `None` if there are none.
    pub(super) fn log(label: &str, values: impl Iterator<Item = f64>) -> Option<Axis> {
        Axis::over(label, Kind::Decades, values.filter(|v| *v > 0.0).map(f64::log10))
    }

    /// The same with ticks at powers of two.
    pub(super) fn log2(label: &str, values: impl Iterator<Item = f64>) -> Option<Axis> {
        Axis::over(label, Kind::Octaves, values.filter(|v| *v > 0.0).map(f64::log10))
    }

    /// Linear from `low` to `high`.
    pub(super) fn linear(label: &str, low: f64, high: f64) -> Axis {
        Axis { label: label.into(), kind: Kind::Linear, low, high: if high > low { high } else { low + 1.0 } }
    }

    fn over(label: &str, kind: Kind, values: impl Iterator<Item = f64>) -> Option<Axis> {
        let (low, high) = values
            .filter(|v| v.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        if low > high {
            return None;
        }
        let margin = (0.05 * (high - low)).max(0.04);
        Some(Axis { label: label.into(), kind, low: low - margin, high: high + margin })
    }

    /// Where `value` lies, held within the range; `None` if it has no place.
    pub(super) fn place(&self, value: f64) -> Option<f64> {
        let at = if self.kind == Kind::Linear { value } else { value.log10() };
        (!at.is_nan()).then(|| at.clamp(self.low, self.high))
    }

    /// Is `value` within the range?
    pub(super) fn holds(&self, value: f64) -> bool {
        let at = if self.kind == Kind::Linear { value } else { value.log10() };
        at >= self.low - 1e-9 && at <= self.high + 1e-9
    }

    /// Grid lines in rising order.
    pub(super) fn ticks(&self) -> Vec<Tick> {
        match self.kind {
            Kind::Linear => self.even_ticks(),
            Kind::Octaves => self.octave_ticks(),
            Kind::Decades => self.decade_ticks(),
        }
    }

    fn even_ticks(&self) -> Vec<Tick> {
        let rough = (self.high - self.low) / 6.0;
        let power = 10f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= rough);
        let step = step.unwrap_or(rough);
        let digits = usize::try_from((-step.log10().floor()) as i64).unwrap_or(0).min(9);
        let first = (self.low / step - 1e-9).ceil() as i64;
        (0..12)
            .map(|i| (first + i) as f64 * step)
            .take_while(|at| *at <= self.high + 1e-9 * step)
            .map(|at| Tick { at, text: Some(format!("{at:.digits$}").replace('-', "−")) })
            .collect()
    }

    fn octave_ticks(&self) -> Vec<Tick> {
        let octave = 2f64.log10();
        let (first, last) = ((self.low / octave).ceil() as i32, (self.high / octave).floor() as i32);
        let step = ((last - first) / 12 + 1).max(1);
        let text = |n: i32| if n >= 0 { plain(2f64.powi(n)) } else { format!("1/{}", 2f64.powi(-n)) };
        let ticks: Vec<Tick> = (first..=last)
            .map(|n| Tick { at: f64::from(n) * octave, text: (n % step == 0).then(|| text(n)) })
            .collect();
        if ticks.is_empty() { self.decade_ticks() } else { ticks }
    }

    fn decade_ticks(&self) -> Vec<Tick> {
        let span = self.high - self.low;
        if span < 0.35 {
            // Within a factor of two there are too few round digits: even steps.
            let even = Axis::linear("", 10f64.powf(self.low), 10f64.powf(self.high)).even_ticks();
            return even.into_iter().map(|tick| Tick { at: tick.at.log10(), ..tick }).collect();
        }
        let (first, last) = (self.low.floor() as i32, self.high.ceil() as i32);
        // Every decade up to ten of them, then every second, third, …
        let step = (span / 10.0).ceil().max(1.0) as i32;
        let named: &[u32] = match span {
            s if s > 3.0 => &[1],
            s if s > 0.9 => &[1, 2, 5],
            _ => &[1, 2, 3, 4, 5, 6, 7, 8, 9],
        };
        let mut ticks = Vec::new();
        for decade in first..last {
            for digit in 1..10u32 {
                let at = f64::from(decade) + f64::from(digit).log10();
                if at < self.low || at > self.high || step > 1 && digit > 1 {
                    continue;
                }
                let has_text = named.contains(&digit) && decade.rem_euclid(step) == 0;
                ticks.push(Tick { at, text: has_text.then(|| decimal(digit, decade)) });
            }
        }
        ticks
    }
}

/// `digit` · 10^`decade`, in full where that is short.
fn decimal(digit: u32, decade: i32) -> String {
    match decade {
        -3..=-1 => format!("{:.*}", decade.unsigned_abs() as usize, f64::from(digit) * 10f64.powi(decade)),
        0..=4 => plain(f64::from(digit) * 10f64.powi(decade)),
        _ => format!("{digit}e{decade}").replace('-', "−"),
    }
}

/// A whole number with a thin gap between thousands.
fn plain(v: f64) -> String {
    let digits = format!("{v:.0}");
    if digits.len() < 5 {
        return digits;
    }
    let mut text = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i) % 3 == 0 {
            text.push('\u{a0}');
        }
        text.push(c);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(axis: &Axis) -> Vec<String> {
        axis.ticks().into_iter().filter_map(|t| t.text).collect()
    }

    #[test]
    fn every_axis_names_some_ticks() {
        for (low, high) in [(1e-9, 1e3), (0.01, 0.02), (3.0, 3.0), (1e-30, 1e30), (0.5, 40.0), (1.1, 1.15)] {
            let axis = Axis::log("x", [low, high].into_iter()).unwrap();
            let count = texts(&axis).len();
            assert!((1..=12).contains(&count), "{low} {high}: {:?}", texts(&axis));
        }
        assert!(Axis::log("x", [f64::NAN, -1.0, 0.0].into_iter()).is_none());
        let samples = Axis::log2("x", [1.0, 1024.0].into_iter()).unwrap();
        assert_eq!(texts(&samples).len(), 11);
        assert_eq!(texts(&Axis::linear("x", 0.0, 0.5)), ["0.0", "0.1", "0.2", "0.3", "0.4", "0.5"]);
    }

    #[test]
    fn ticks_read_as_numbers() {
        let axis = Axis::log("x", [1e-6, 1.0].into_iter()).unwrap();
        assert_eq!(texts(&axis), ["1e−6", "1e−5", "1e−4", "0.001", "0.01", "0.1", "1"]);
        assert_eq!(plain(1_234_567.0), "1\u{a0}234\u{a0}567");
    }
}
