//! Mitsuba references and the test against them.

#![allow(dead_code, reason = "not every test binary uses all of it")]

use std::path::PathBuf;

use etendue::load::{LoadOptions, load, read_picture};
use etendue::render::{Quiet, render};
use etendue::study::{Pair, RgbView, ZOptions, ZReport, z_test};
use serde_json::Value;

use super::render::{Ready, options, package, rgb};

/// A reference: mean, variance of the mean, and how it was made.
pub struct Reference {
    /// Its name.
    pub name: String,
    /// Its provenance.
    pub provenance: Value,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Its pixels, three channels each.
    pub mean: Vec<f32>,
    /// Variance of these.
    pub variance: Vec<f32>,
}

/// Independent renders that our mean and variance are made of, at least.
const BATCHES: u64 = 16;
/// Samples per pixel of each batch of the pilot, and of any batch at most.
const SAMPLES: (u64, u64) = (16, 1024);
/// Relative standard error of the whole mean that is asked of our side: the
/// reference's own, but within these.
const WANTED: (f64, f64) = (1e-4, 6e-4);
/// Samples in all batches beyond which a decision is enough …
const BUDGET: u64 = 40_000_000;
/// … that is, this relative standard error of the difference of whole means;
/// from 1e-3 on the test calls it inconclusive.
const DECIDES: f64 = 9.8e-4;
/// Most samples per pixel: where an estimator ends that does not converge.
pub const MOST: u64 = 100_000;

/// True when `ETENDUE_REFERENCE_LONG` asks for the wanted error at any cost.
fn long_run() -> bool {
    std::env::var_os("ETENDUE_REFERENCE_LONG").is_some()
}

/// Our picture with its variance.
pub struct Ours {
    /// Mean of all batches, interleaved RGB.
    pub mean: Vec<f32>,
    /// Variance of that mean.
    pub variance: Vec<f32>,
    /// Relative standard error of the whole mean.
    pub mean_error: f64,
    /// Independent renders that it is made of.
    pub batches: u64,
    /// Samples per pixel of each.
    pub samples: u64,
}

/// Names of all references, sorted.
pub fn names() -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(package("refs"))
        .expect("the folder refs")
        .filter_map(|e| e.ok()?.file_name().into_string().ok())
        .filter_map(|n| n.strip_suffix(".var.exr").map(str::to_owned))
        .collect();
    names.sort();
    names
}

fn interleaved(path: PathBuf) -> (usize, usize, Vec<f32>) {
    let picture = read_picture(&path).unwrap_or_else(|e| panic!("{e}"));
    let [r, g, b] = ["R", "G", "B"].map(|n| picture.channel(n).expect("a colour channel"));
    let data = r.iter().zip(g).zip(b).flat_map(|((r, g), b)| [*r, *g, *b]).collect();
    (picture.width as usize, picture.height as usize, data)
}

impl Reference {
    /// Reads `refs/NAME.*`.
    pub fn read(name: &str) -> Reference {
        let text = std::fs::read_to_string(package(&format!("refs/{name}.json"))).expect("the provenance");
        let provenance = serde_json::from_str(&text).expect("valid JSON");
        let (width, height, mean) = interleaved(package(&format!("refs/{name}.exr")));
        let (_, _, variance) = interleaved(package(&format!("refs/{name}.var.exr")));
        Reference { name: name.to_owned(), provenance, width, height, mean, variance }
    }

    /// The scene it is a picture of, with the same parameters; where it stands as
    /// glTF too, that file.
    pub fn scene(&self, change: impl FnOnce(&mut etendue::desc::SceneDesc)) -> Ready {
        let defines = self.provenance["defines"].as_object().expect("defines");
        let plain = |v: &Value| v.as_str().map_or_else(|| v.to_string(), str::to_owned);
        let defines = defines.iter().map(|(k, v)| (k.clone(), plain(v))).collect();
        let gltf = self.provenance["gltf"].as_str();
        let path = package(gltf.unwrap_or_else(|| self.provenance["scene"].as_str().expect("a scene")));
        let options = LoadOptions { defines, ..LoadOptions::default() };
        let mut desc = load(&path, &options).unwrap_or_else(|e| panic!("{e}"));
        change(&mut desc);
        // A glTF file says nothing about pixels.
        let size = gltf.map(|_| [self.width as u32, self.height as u32]);
        Ready::sized(&desc, size)
    }

    /// The error asked of our side after `samples` in all.
    fn target(&self, samples: u64) -> f64 {
        let wanted = self.mean_error().clamp(WANTED.0, WANTED.1);
        if samples < BUDGET || long_run() {
            return wanted;
        }
        (DECIDES.powi(2) - self.mean_error().powi(2)).max(0.0).sqrt().max(wanted)
    }

    /// Renders independent batches of `picture(samples, seed)` until the whole
    /// mean is known well enough.
    ///
    /// A pilot says how many samples that takes; batches of two thirds of
    /// what 16 would need follow, since low-discrepancy samples often do better
    /// than 1/√n, and more of the same until it is enough. The pilot's are
    /// dropped: a few per cent. Stops at `most` samples per pixel in any case.
    pub fn batches(&self, most: u64, mut picture: impl FnMut(u64, u64) -> Vec<f32>) -> Ours {
        let pixels = (self.width * self.height) as u64;
        let mut samples = SAMPLES.0;
        let mut sums = Sums::default();
        loop {
            while sums.count < BATCHES {
                sums.add(&picture(samples, 1000 + sums.count));
            }
            let need = (sums.mean_error() / self.target(sums.count * samples * pixels)).powi(2);
            if need <= 1.0 || sums.count * samples >= most {
                return sums.ours(samples);
            }
            let larger = ((samples as f64 * need / 1.5) as u64).min(SAMPLES.1).min(most / BATCHES);
            // The smoother a picture, the faster than 1/√n its error falls: a large
            // step would be too large, unless even so the largest one is needed.
            let larger = if larger < SAMPLES.1 { larger.min(8 * samples) } else { larger };
            if sums.count == BATCHES && larger >= 4 * samples {
                (samples, sums) = (larger, Sums::default());
                continue;
            }
            for _ in 0..(sums.count as f64 * (need - 1.0)).ceil().clamp(1.0, 4.0) as u64 {
                sums.add(&picture(samples, 1000 + sums.count));
            }
        }
    }

    /// Our estimate of the same picture, by the library.
    pub fn ours(&self, ready: &Ready) -> Ours {
        self.batches(MOST, |samples, seed| {
            let rendered = render(&ready.scene, &ready.integrator, &options(samples, seed), &Quiet)
                .unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(rendered.stats.bad.total(), 0, "{}: {}", self.name, rendered.stats.bad.summary());
            rgb(&rendered.film.resolve())
        })
    }

    /// The test of ours against it.
    pub fn test(&self, ours: &Ours, overlap: f64) -> ZReport {
        let view = |data| RgbView::new(self.width, self.height, data).unwrap_or_else(|e| panic!("{e}"));
        let pair = Pair::new(view(&ours.mean), view(&self.mean)).unwrap_or_else(|e| panic!("{e}"));
        let options = ZOptions {
            overlap,
            image_mean_error: Some(ours.mean_error),
            reference_mean_error: Some(self.mean_error()),
            image_freedom: (ours.batches - 1) as f64,
            reference_freedom: self.provenance["passes"].as_f64().expect("a count of passes") - 1.0,
            ..ZOptions::default()
        };
        z_test(&pair, Some(view(&ours.variance)), Some(view(&self.variance)), &options)
            .unwrap_or_else(|e| panic!("{e}"))
    }

    /// Relative standard error of the reference's whole mean, measured from
    /// its passes.
    pub fn mean_error(&self) -> f64 {
        self.provenance["mean_luminance_relative_error"].as_f64().expect("the error of the mean")
    }

    /// Writes image, reference and error where a person can look at them.
    pub fn dump(&self, ours: &Ours) -> PathBuf {
        let folder = package("target/reference-failures");
        std::fs::create_dir_all(&folder).expect("a folder for failures");
        for (suffix, data) in [("ours", &ours.mean), ("reference", &self.mean)] {
            let pixels: Vec<u8> =
                data.iter().map(|v| (v.max(0.0).powf(1.0 / 2.2) * 255.0).min(255.0) as u8).collect();
            let path = folder.join(format!("{}-{suffix}.png", self.name));
            image::save_buffer(path, &pixels, self.width as u32, self.height as u32, image::ColorType::Rgb8)
                .expect("a PNG");
        }
        folder
    }
}

/// Sums over batches: per value its mean and squared deviations (Welford), and
/// every batch's total.
#[derive(Default)]
struct Sums {
    count: u64,
    values: Vec<(f64, f64)>,
    totals: Vec<f64>,
}

impl Sums {
    fn add(&mut self, batch: &[f32]) {
        self.count += 1;
        self.values.resize(batch.len(), (0.0, 0.0));
        for ((mean, squares), value) in self.values.iter_mut().zip(batch) {
            let step = f64::from(*value) - *mean;
            *mean += step / self.count as f64;
            *squares += step * (f64::from(*value) - *mean);
        }
        self.totals.push(batch.iter().map(|v| f64::from(*v)).sum());
    }

    /// Relative standard error of the whole mean.
    fn mean_error(&self) -> f64 {
        let n = self.count as f64;
        let mean = self.totals.iter().sum::<f64>() / n;
        let squares: f64 = self.totals.iter().map(|t| (t - mean).powi(2)).sum();
        (squares / (n - 1.0) / n).sqrt() / mean
    }

    fn ours(&self, samples: u64) -> Ours {
        let n = self.count as f64;
        Ours {
            mean: self.values.iter().map(|v| v.0 as f32).collect(),
            variance: self.values.iter().map(|v| (v.1 / (n - 1.0) / n) as f32).collect(),
            mean_error: self.mean_error(),
            batches: self.count,
            samples,
        }
    }
}

/// 1/∫w² of a filter along both axes: how many pixels share a sample.
pub fn overlap(filter: &etendue::film::Filter) -> f64 {
    let (radius, steps) = (filter.radius(), 2000);
    let values =
        (0..steps).map(|i| filter.eval(((f64::from(i) + 0.5) / f64::from(steps) * 2.0 - 1.0) * radius));
    let (sum, squares) = values.fold((0.0, 0.0), |(s, q), w| (s + w, q + w * w));
    let step = 2.0 * radius / f64::from(steps);
    let one_axis = (sum * step).powi(2) / (squares * step);
    one_axis * one_axis
}
