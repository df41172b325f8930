//! Single wavelengths for a renderer in RGB, where light of each goes its own way.
//!
//! A wavelength is drawn with a probability in proportion to how much of the
//! three primaries it is, and stands for all with a colour whose mean is white.
//! Its colours are those of the CIE 1931 observer in linear sRGB without what is
//! negative: colours of a prism are out of gamut, and what a primary lacks there
//! is not taken from others.

use std::sync::LazyLock;

use super::spectrum::matching_rgb;
use crate::math::Rgb;

/// Bins of 5 nm from 380 nm on; beyond them there is next to nothing.
const BINS: usize = 70;
const FIRST: f64 = 380.0;
const STEP: f64 = 5.0;

/// A wavelength and what it makes of white light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hue {
    /// In nanometres, from 380 to 730.
    pub wavelength: f32,
    /// Weight of each channel, at least 0; their mean over all numbers that
    /// [`Hue::sample`] takes is 1, and their sum is always 3.
    pub colour: Rgb,
}

struct Bin {
    /// Probability of all bins up to the end of this one.
    end: f64,
    colour: Rgb,
}

static TABLE: LazyLock<Vec<Bin>> = LazyLock::new(|| {
    let middle = |i: usize| FIRST + (i as f64 + 0.5) * STEP;
    let seen: Vec<[f64; 3]> = (0..BINS).map(|i| matching_rgb(middle(i)).map(|c| c.max(0.0))).collect();
    let sums: [f64; 3] = std::array::from_fn(|c| seen.iter().map(|rgb| rgb[c]).sum());
    let mut end = 0.0;
    let bin = |rgb: &[f64; 3]| {
        let share: [f64; 3] = std::array::from_fn(|c| rgb[c] / sums[c]);
        let probability = share.iter().sum::<f64>() / 3.0;
        end += probability;
        Bin { end, colour: Rgb::from_array(share.map(|s| (s / probability) as f32)) }
    };
    seen.iter().map(bin).collect()
});

impl Hue {
    /// The hue of a wavelength from 380 to 730 nm.
    #[must_use]
    pub fn of(wavelength: f32) -> Hue {
        let i = ((f64::from(wavelength) - FIRST) / STEP) as usize;
        Hue { wavelength, colour: TABLE[i.min(BINS - 1)].colour }
    }

    /// The wavelength of a uniform number in [0, 1).
    #[must_use]
    pub fn sample(u: f32) -> Hue {
        let u = f64::from(u);
        let i = TABLE.partition_point(|bin| bin.end <= u).min(BINS - 1);
        let start = if i == 0 { 0.0 } else { TABLE[i - 1].end };
        let within = ((u - start) / (TABLE[i].end - start)).clamp(0.0, 1.0);
        Hue { wavelength: (FIRST + (i as f64 + within) * STEP) as f32, colour: TABLE[i].colour }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_hues_together_are_white() {
        let n = 1 << 16;
        let (mut sum, mut last) = ([0.0f64; 3], 0.0);
        for i in 0..n {
            let Hue { wavelength, colour } = Hue::sample((i as f32 + 0.5) / n as f32);
            assert!(wavelength >= last && (380.0..=730.0).contains(&wavelength), "{wavelength}");
            assert!(colour.min_element() >= 0.0 && (colour.element_sum() - 3.0).abs() < 1e-5, "{colour}");
            last = wavelength;
            // Rounding may take it over the end of its bin.
            let [below, above] = [-1e-4, 1e-4].map(|d| Hue::of(wavelength + d).colour);
            assert!(colour == below || colour == above, "{wavelength}");
            for (sum, c) in sum.iter_mut().zip(colour.to_array()) {
                *sum += f64::from(c) / f64::from(n);
            }
        }
        assert!(sum.iter().all(|s| (s - 1.0).abs() < 1e-3), "{sum:?}");
        let [blue, green, red] = [0.1, 0.5, 0.9].map(|u| Hue::sample(u).colour);
        assert!(blue.z > 2.0 && green.y > 1.0 && red.x > 1.5, "{blue} {green} {red}");
    }
}
