//! FLIP: how visible a difference is when two pictures are flipped between.
//!
//! [`flip_ldr`] is "FLIP: A Difference Evaluator for Alternating Images",
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild, HPG 2020,
//! for display-linear pictures in [0, 1]. [`flip_hdr`] is "Visualizing Errors
//! in Rendered High Dynamic Range Images", Andersson, Nilsson, Shirley,
//! Akenine-Möller, Eurographics 2021: the largest LDR error of a pixel over a
//! ladder of exposures, each tone-mapped by Narkowicz's fit of ACES. The
//! ladder is chosen from the reference as in that paper: from the exposure
//! that maps its brightest luminance to 0.85 to the one that maps its median
//! there, in about whole stops.
//!
//! The observer sees 67.02 pixels per degree: a monitor 0.7 m wide and 0.7 m
//! away, with 3840 pixels across. All filters are sums of separable Gaussians.
//! NaN, infinite and negative values are read as 0. Where it breaks: a
//! reference whose median is black has no upper exposure; the ladder then ends
//! [`MAX_STOPS`] above its start.

use std::f64::consts::PI;

use super::metrics::{Pair, RgbView};

/// Pixels per degree of visual angle: 0.7 m × (3840 / 0.7 m) × π / 180.
const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;
/// Exponent of the colour difference (HPG 2020, section 4.1.3).
const COLOR_EXPONENT: f64 = 0.7;
/// Exponent of the feature difference (section 4.2).
const FEATURE_EXPONENT: f64 = 0.5;
/// Knee of the redistribution of colour errors: input, as a part of the largest.
const KNEE: f64 = 0.4;
/// Knee of the redistribution of colour errors: output.
const KNEE_VALUE: f64 = 0.95;
/// Width of the feature detector in degrees.
const FEATURE_WIDTH: f64 = 0.082;
/// Luminance after tone mapping that ends the ladder of exposures on both sides.
const EXPOSURE_TARGET: f64 = 0.85;
/// Longest ladder of exposures in stops.
pub const MAX_STOPS: f64 = 40.0;

/// Rec. 709 primaries, D65, to XYZ: the exact rationals of the sRGB standard.
const TO_XYZ: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];
/// The inverse of [`TO_XYZ`].
const FROM_XYZ: [[f64; 3]; 3] = [
    [3.241_003_275, -1.537_398_934, -0.498_615_861],
    [-0.969_224_334, 1.875_930_071, 0.041_554_224],
    [0.055_639_423, -0.204_011_202, 1.057_148_933],
];
/// XYZ of (1, 1, 1).
const WHITE: [f64; 3] = [0.950_428_545, 1.0, 1.088_900_371];

/// The result of [`flip_hdr`].
#[derive(Clone, Debug, PartialEq)]
pub struct FlipHdr {
    /// Mean of `map`.
    pub mean: f64,
    /// FLIP of every pixel, in [0, 1], rows from the top.
    pub map: Vec<f32>,
    /// log₂ of the darkest exposure.
    pub start_exposure: f64,
    /// log₂ of the brightest exposure.
    pub stop_exposure: f64,
    /// Number of exposures, evenly spaced.
    pub exposures: usize,
}

/// FLIP of scene-linear pictures, by the largest error over the exposures.
#[must_use]
pub fn flip_hdr(pair: &Pair<'_>) -> FlipHdr {
    let (start, stop) = exposure_range(&pair.reference());
    let exposures = ((stop - start).ceil() as usize).max(2);
    let step = (stop - start) / (exposures - 1) as f64;
    let mut map = vec![0.0_f32; pair.reference().pixels()];
    for index in 0..exposures {
        let gain = (start + step * index as f64).exp2();
        let display = |view: RgbView<'_>| -> Vec<[f64; 3]> {
            let mapped = |v: f32| tone_map(gain * f64::from(v));
            view.data.chunks_exact(3).map(|p| [mapped(p[0]), mapped(p[1]), mapped(p[2])]).collect()
        };
        let width = pair.reference().width;
        let errors = flip(&display(pair.image()), &display(pair.reference()), width);
        for (worst, error) in map.iter_mut().zip(errors) {
            *worst = worst.max(error as f32);
        }
    }
    let mean = map.iter().map(|e| f64::from(*e)).sum::<f64>() / map.len() as f64;
    FlipHdr { mean, map, start_exposure: start, stop_exposure: stop, exposures }
}

/// FLIP of display-linear pictures (sRGB-encoded ones must be decoded first):
/// the error of every pixel in [0, 1], rows from the top. Values outside of
/// [0, 1] are clamped.
#[must_use]
pub fn flip_ldr(pair: &Pair<'_>) -> Vec<f32> {
    let display = |view: RgbView<'_>| -> Vec<[f64; 3]> {
        let clamped = |v: f32| if v.is_finite() { f64::from(v).clamp(0.0, 1.0) } else { 0.0 };
        view.data.chunks_exact(3).map(|p| [clamped(p[0]), clamped(p[1]), clamped(p[2])]).collect()
    };
    let errors = flip(&display(pair.image()), &display(pair.reference()), pair.reference().width);
    errors.into_iter().map(|e| e as f32).collect()
}

/// Narkowicz's fit of the ACES curve, clamped to [0, 1].
fn tone_map(value: f64) -> f64 {
    if !(value > 0.0 && value.is_finite()) {
        return 0.0;
    }
    let x = 0.6 * value.min(1e9);
    ((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)).min(1.0)
}

/// The value that [`tone_map`] takes to `target`.
fn inverse_tone_map(target: f64) -> f64 {
    // (2.51 − 2.43 t) x² + (0.03 − 0.59 t) x − 0.14 t = 0, and x = 0.6 v.
    let (a, b, c) = (2.51 - 2.43 * target, 0.03 - 0.59 * target, -0.14 * target);
    (-b + (b * b - 4.0 * a * c).sqrt()) / (2.0 * a) / 0.6
}

/// log₂ of the exposures that take the brightest and the median luminance of
/// the reference to [`EXPOSURE_TARGET`].
fn exposure_range(reference: &RgbView<'_>) -> (f64, f64) {
    let clean = |v: f32| if v.is_finite() && v > 0.0 { f64::from(v) } else { 0.0 };
    let luminance = |p: &[f32]| 0.2126 * clean(p[0]) + 0.7152 * clean(p[1]) + 0.0722 * clean(p[2]);
    let mut values: Vec<f64> = reference.data.chunks_exact(3).map(luminance).collect();
    values.sort_unstable_by(f64::total_cmp);
    let n = values.len();
    let (brightest, median) = (values[n - 1], 0.5 * (values[(n - 1) / 2] + values[n / 2]));
    if brightest == 0.0 {
        return (0.0, 0.0);
    }
    let target = inverse_tone_map(EXPOSURE_TARGET);
    let start = (target / brightest).log2();
    (start, (target / median).log2().min(start + MAX_STOPS))
}

/// FLIP of two display-linear pictures of the same size.
fn flip(image: &[[f64; 3]], reference: &[[f64; 3]], width: usize) -> Vec<f64> {
    let largest = hyab(hunt_lab([0.0, 1.0, 0.0]), hunt_lab([0.0, 0.0, 1.0])).powf(COLOR_EXPONENT);
    let (a, b) = (Perceived::new(image, width), Perceived::new(reference, width));
    a.pixels
        .iter()
        .zip(&b.pixels)
        .map(|(a, b)| {
            let color = redistribute(hyab(a.lab, b.lab).powf(COLOR_EXPONENT), largest);
            let feature = (a.edge - b.edge).abs().max((a.point - b.point).abs());
            color.powf(1.0 - (feature / 2_f64.sqrt()).powf(FEATURE_EXPONENT))
        })
        .collect()
}

/// A picture as the observer sees it.
struct Perceived {
    pixels: Vec<PerceivedPixel>,
}

struct PerceivedPixel {
    /// Filtered by contrast sensitivity, in L*a*b* with Hunt's adjustment.
    lab: [f64; 3],
    /// Strength of an edge here.
    edge: f64,
    /// Strength of a point or line here.
    point: f64,
}

impl Perceived {
    fn new(picture: &[[f64; 3]], width: usize) -> Perceived {
        let opponent: Vec<[f64; 3]> = picture.iter().map(|rgb| to_ycxcz(*rgb)).collect();
        let channel =
            |c: usize| -> Plane { Plane { width, values: opponent.iter().map(|p| p[c] as f32).collect() } };
        let achromatic = channel(0);

        // Blur each channel by the contrast sensitivity of the eye.
        let filtered = [
            contrast_filter(&achromatic, &[(1.0, 0.0047)]),
            contrast_filter(&channel(1), &[(1.0, 0.0053)]),
            contrast_filter(&channel(2), &[(34.1, 0.04), (13.5, 0.025)]),
        ];

        // Detect edges and points in the normalised luminance.
        let luminance =
            Plane { width, values: achromatic.values.iter().map(|y| (y + 16.0) / 116.0).collect() };
        let detector = FeatureDetector::new();
        let edges = detector.strength(&luminance, &detector.edge);
        let points = detector.strength(&luminance, &detector.point);

        let pixels = (0..picture.len())
            .map(|i| {
                let seen = [0, 1, 2].map(|c: usize| f64::from(filtered[c].values[i]));
                let rgb = from_ycxcz(seen).map(|v| v.clamp(0.0, 1.0));
                PerceivedPixel { lab: hunt_lab(rgb), edge: f64::from(edges[i]), point: f64::from(points[i]) }
            })
            .collect();
        Perceived { pixels }
    }
}

/// One channel of a picture.
struct Plane {
    width: usize,
    values: Vec<f32>,
}

impl Plane {
    /// Convolves with `horizontal` ⊗ `vertical`; pixels beyond the border
    /// repeat it.
    fn convolve(&self, horizontal: &[f32], vertical: &[f32]) -> Plane {
        let (width, height) = (self.width, self.values.len() / self.width);
        let clamped = |at: usize, offset: usize, radius: usize, size: usize| {
            (at + offset).saturating_sub(radius).min(size - 1)
        };
        let mut rows = vec![0.0_f32; self.values.len()];
        let radius = horizontal.len() / 2;
        for (row, out) in self.values.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
            for (x, value) in out.iter_mut().enumerate() {
                let taps = horizontal.iter().enumerate();
                *value = taps.map(|(k, w)| w * row[clamped(x, k, radius, width)]).sum();
            }
        }
        let mut values = vec![0.0_f32; self.values.len()];
        let radius = vertical.len() / 2;
        for (y, out) in values.chunks_exact_mut(width).enumerate() {
            for (k, w) in vertical.iter().enumerate() {
                let from = clamped(y, k, radius, height) * width;
                for (value, input) in out.iter_mut().zip(&rows[from..from + width]) {
                    *value += w * input;
                }
            }
        }
        Plane { width, values }
    }
}

/// Filters by a sum of Gaussians a √(π / b) exp(−π² d² / b), d in degrees
/// (HPG 2020, equation 3), normalised to sum to 1.
fn contrast_filter(plane: &Plane, terms: &[(f64, f64)]) -> Plane {
    // All channels share the radius of the widest Gaussian.
    let radius = (3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i32;
    let gaussians: Vec<(f64, Vec<f64>)> = terms
        .iter()
        .map(|&(a, b)| {
            let at = |i: i32| (-(PI * f64::from(i) / PIXELS_PER_DEGREE).powi(2) / b).exp();
            (a * (PI / b).sqrt(), (-radius..=radius).map(at).collect())
        })
        .collect();
    let total: f64 = gaussians.iter().map(|(a, g)| a * g.iter().sum::<f64>().powi(2)).sum();
    let mut values = vec![0.0_f32; plane.values.len()];
    for (a, g) in &gaussians {
        let horizontal: Vec<f32> = g.iter().map(|w| (w * a / total) as f32).collect();
        let vertical: Vec<f32> = g.iter().map(|w| *w as f32).collect();
        for (sum, term) in values.iter_mut().zip(plane.convolve(&horizontal, &vertical).values) {
            *sum += term;
        }
    }
    Plane { width: plane.width, values }
}

/// First and second derivative of a Gaussian (HPG 2020, section 4.2), the
/// positive and the negative weights of each summing to 1 and −1.
struct FeatureDetector {
    gaussian: Vec<f32>,
    edge: Vec<f32>,
    point: Vec<f32>,
}

impl FeatureDetector {
    fn new() -> FeatureDetector {
        let deviation = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
        let radius = (3.0 * deviation).ceil() as i32;
        let gaussian = |i: i32| (-f64::from(i * i) / (2.0 * deviation * deviation)).exp();
        let curve = |weight: &dyn Fn(f64) -> f64| -> Vec<f64> {
            (-radius..=radius).map(|i| weight(f64::from(i)) * gaussian(i)).collect()
        };
        let smooth = curve(&|_| 1.0);
        let total: f64 = smooth.iter().sum();
        FeatureDetector {
            gaussian: smooth.iter().map(|w| (w / total) as f32).collect(),
            edge: balanced(&curve(&|x| -x)),
            point: balanced(&curve(&|x| x * x / (deviation * deviation) - 1.0)),
        }
    }

    /// Length of the response along both axes.
    fn strength(&self, plane: &Plane, weights: &[f32]) -> Vec<f32> {
        let along_x = plane.convolve(weights, &self.gaussian);
        let along_y = plane.convolve(&self.gaussian, weights);
        along_x.values.iter().zip(&along_y.values).map(|(x, y)| x.hypot(*y)).collect()
    }
}

/// Scales the positive weights to sum to 1, the negative ones to −1.
fn balanced(weights: &[f64]) -> Vec<f32> {
    let sum = |sign: f64| weights.iter().map(|w| (sign * w).max(0.0)).sum::<f64>();
    let (positive, negative) = (sum(1.0), sum(-1.0));
    weights.iter().map(|w| (w / if *w < 0.0 { negative } else { positive }) as f32).collect()
}

/// Spreads the colour errors over [0, 1] (HPG 2020, section 4.1.3).
fn redistribute(error: f64, largest: f64) -> f64 {
    let knee = KNEE * largest;
    if error < knee {
        KNEE_VALUE * error / knee
    } else {
        KNEE_VALUE + (1.0 - KNEE_VALUE) * (error - knee) / (largest - knee)
    }
}

/// Distance of colours: city block in lightness, Euclidean in chroma.
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// L*a*b* with chroma scaled by lightness (Hunt's effect).
fn hunt_lab(rgb: [f64; 3]) -> [f64; 3] {
    let delta = 6.0_f64 / 29.0;
    let curve = |t: f64| {
        if t > delta.powi(3) { t.cbrt() } else { t / (3.0 * delta * delta) + 4.0 / 29.0 }
    };
    let [x, y, z] = relative_xyz(rgb).map(curve);
    let lightness = 116.0 * y - 16.0;
    let scale = 0.01 * lightness;
    [lightness, scale * 500.0 * (x - y), scale * 200.0 * (y - z)]
}

/// Linear counterpart of L*a*b*, in which blurring keeps the mean.
fn to_ycxcz(rgb: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = relative_xyz(rgb);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn from_ycxcz([l, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (l + 16.0) / 116.0;
    let xyz = [(y + cx / 500.0) * WHITE[0], y * WHITE[1], (y - cz / 200.0) * WHITE[2]];
    FROM_XYZ.map(|row| row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2])
}

/// XYZ in units of the white point.
fn relative_xyz(rgb: [f64; 3]) -> [f64; 3] {
    let xyz = TO_XYZ.map(|row| row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2]);
    [xyz[0] / WHITE[0], xyz[1] / WHITE[1], xyz[2] / WHITE[2]]
}
