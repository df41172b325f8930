//! What a study measured and concludes: plain data, written to `study.json`
//! and read by the report.
//!
//! Times are seconds. CPU time is that of all threads, of rendering alone.
//! `f64::NAN` and infinities are written as `null`.

use serde::{Deserialize, Serialize};

/// A whole study.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Study {
    /// Title of the report.
    pub title: String,
    /// Version of the program.
    pub version: String,
    /// Where it ran.
    pub machine: Machine,
    /// Level of every interval, 0.95.
    pub confidence: f64,
    /// Independent runs of each configuration and budget.
    pub repeats: usize,
    /// One section of the report each.
    pub scenes: Vec<SceneStudy>,
    /// What the reader should know before believing a number.
    pub notes: Vec<String>,
}

/// Where a study ran.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Machine {
    /// Name of the processor, or its architecture.
    pub cpu: String,
    /// Hardware threads of the machine.
    pub cores: usize,
    /// Threads that rendered.
    pub threads: usize,
    /// CPU seconds ÷ (wall seconds × threads), over all runs: well under 1
    /// says that something else ran too.
    #[serde(with = "nullable")]
    pub load: f64,
}

/// All configurations on one scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SceneStudy {
    /// Name, unique in the study.
    pub name: String,
    /// The scene file as it was given.
    pub file: String,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// What error is measured against.
    pub reference: Reference,
    /// What is measured: `colour` first, then layers (`albedo`) and regions
    /// (`colour in NAME`).
    pub targets: Vec<String>,
    /// Name of the configuration that others are compared with.
    pub baseline: String,
    /// In the order of the plan.
    pub configurations: Vec<ConfigurationStudy>,
    /// Every other configuration against the baseline, for colour.
    pub comparisons: Vec<Comparison>,
}

/// What error is measured against.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Reference {
    /// A picture.
    Picture {
        /// The file as it was given.
        file: String,
        /// Where it comes from, as far as its header or the JSON beside it says.
        provenance: Vec<(String, String)>,
        /// Where its variance comes from (a file, its error layer), if it is known.
        variance: Option<String>,
        /// MSE that its own noise adds; subtracted from every MSE.
        #[serde(with = "nullable")]
        noise_mse: f64,
        /// relMSE that its own noise adds; subtracted from every relMSE.
        #[serde(with = "nullable")]
        noise_rel_mse: f64,
    },
    /// No picture: the error is the sample variance over independent runs,
    /// which sees noise but no bias.
    Replicates,
}

/// A value and the interval that holds the truth at the study's confidence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// The estimate.
    #[serde(with = "nullable")]
    pub value: f64,
    /// Lower end.
    #[serde(with = "nullable")]
    pub low: f64,
    /// Upper end.
    #[serde(with = "nullable")]
    pub high: f64,
}

/// One configuration on one scene.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ConfigurationStudy {
    /// Name, as `path, sobol`.
    pub name: String,
    /// What is varied: key and value, as `sampler` and `sobol`.
    pub settings: Vec<(String, String)>,
    /// Made by another program and taken in with `--series`.
    pub external: bool,
    /// What it computes, if not all light (`direct light only`): why it does
    /// not converge to the reference by design.
    pub biased_by_design: Option<String>,
    /// By growing budget.
    pub rungs: Vec<Rung>,
    /// Slopes of error against time and samples.
    pub fits: Vec<Fit>,
    /// CPU seconds until relMSE of colour is 1 % and 0.5 % squared.
    pub time_to: Vec<TimeTo>,
    /// Does it converge to the reference? Absent without a reference.
    pub bias: Option<BiasTest>,
    /// Of the largest budget. Absent with fewer than two runs.
    pub noise: Option<Noise>,
    /// How good the error layer is, where the pictures have one.
    pub calibration: Option<Calibration>,
}

/// All runs of one configuration with one budget.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Rung {
    /// As `64 spp` or `8 s`.
    pub budget: String,
    /// Samples per pixel, mean over the runs.
    #[serde(with = "nullable")]
    pub samples_per_pixel: f64,
    /// CPU seconds of each run.
    pub cpu_seconds: Vec<f64>,
    /// Wall-clock seconds of each run.
    pub wall_seconds: Vec<f64>,
    /// Mean CPU seconds.
    pub cpu: Interval,
    /// Mean wall-clock seconds.
    pub wall: Interval,
    /// Relative error that the renderer itself reports, mean over the runs.
    #[serde(with = "nullable")]
    pub reported_error: f64,
    /// By target and metric.
    pub figures: Vec<Figure>,
    /// 1 ÷ (relMSE of colour × CPU seconds).
    pub efficiency: Interval,
}

/// One metric of one target at one rung.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Figure {
    /// One of the scene's targets.
    pub target: String,
    /// What is measured.
    pub metric: Metric,
    /// Mean over the runs, noise of the reference subtracted where the metric
    /// is a square.
    pub mean: Interval,
    /// Each run, in the order of `Rung::cpu_seconds`.
    #[serde(with = "nullable_list")]
    pub runs: Vec<f64>,
    /// Below this the noise of the reference rules; 0 if it is unknown or plays no part.
    #[serde(with = "nullable")]
    pub floor: f64,
    /// The figure is too near to the floor to be believed: print no number.
    pub limited: bool,
}

/// What a figure measures; formulas in `study::metrics` and `docs/studies.md`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Metric {
    /// Mean squared error.
    Mse,
    /// Relative mean squared error.
    RelMse,
    /// The same without the worst 0.1 % of the values.
    RelMseTrimmed,
    /// Mean absolute relative error.
    Mape,
    /// Its symmetric form.
    Smape,
    /// Peak signal-to-noise ratio in dB: larger is better.
    Psnr,
    /// FLIP of the tone-mapped pictures.
    FlipLdr,
    /// HDR-FLIP.
    FlipHdr,
    /// (mean of the picture − mean of the reference) ÷ the latter: signed.
    Bias,
}

impl Metric {
    /// All, in the order of tables.
    pub const ALL: [Metric; 9] = [
        Metric::Mse,
        Metric::RelMse,
        Metric::RelMseTrimmed,
        Metric::Mape,
        Metric::Smape,
        Metric::Psnr,
        Metric::FlipLdr,
        Metric::FlipHdr,
        Metric::Bias,
    ];

    /// For tables and axes.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Metric::Mse => "MSE",
            Metric::RelMse => "relMSE",
            Metric::RelMseTrimmed => "relMSE without the worst 0.1 %",
            Metric::Mape => "MAPE",
            Metric::Smape => "SMAPE",
            Metric::Psnr => "PSNR (dB)",
            Metric::FlipLdr => "FLIP (LDR)",
            Metric::FlipHdr => "FLIP (HDR)",
            Metric::Bias => "mean bias",
        }
    }
}

/// Slope of log error against log cost over all rungs.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Fit {
    /// What is fitted.
    pub metric: Metric,
    /// Against what.
    pub against: Cost,
    /// −1 is the rate of independent samples for squared errors.
    pub slope: Interval,
    /// The same over the last three rungs alone: is it stalling?
    pub last: Interval,
    /// One sentence: at the Monte Carlo rate, faster, slower, or stalled.
    pub verdict: String,
}

/// The abscissa of a plot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cost {
    /// CPU seconds of rendering.
    Cpu,
    /// Samples per pixel.
    Samples,
}

/// CPU seconds until the root of relMSE of colour is at most `error`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TimeTo {
    /// 0.01 or 0.005.
    #[serde(with = "nullable")]
    pub error: f64,
    /// CPU seconds; NaN when it cannot be told, as for a curve that stalls.
    pub cpu: Interval,
    /// Beyond the measured range: taken from the slope.
    pub extrapolated: bool,
}

/// Does a configuration converge to the reference?
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct BiasTest {
    /// The rung tested: the largest budget with at least two runs.
    pub budget: String,
    /// Relative difference of the whole picture's mean.
    pub mean: Interval,
    /// Largest |z| of the blocks of 8 × 8 pixels.
    #[serde(with = "nullable")]
    pub worst_z: f64,
    /// Column and row of that block, in pixels.
    pub worst_at: [usize; 2],
    /// |z| that a block may have, corrected for their number.
    #[serde(with = "nullable")]
    pub threshold: f64,
    /// Probability that an unbiased configuration fails the test.
    pub false_positive_rate: f64,
    /// What it says.
    pub verdict: BiasVerdict,
    /// The same in a sentence.
    pub text: String,
}

/// Outcome of a bias test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BiasVerdict {
    /// No bias is seen.
    Converges,
    /// The means differ.
    Biased,
    /// Too noisy, or the reference is.
    Undecided,
}

/// The noise of one configuration at its largest budget.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Noise {
    /// The rung.
    pub budget: String,
    /// Radially averaged power of the relative error: frequency in cycles per
    /// pixel (0 to 0.5) and power in units of white noise of the same energy.
    pub spectrum: Vec<[f64; 2]>,
    /// One word and why: white, blue or red (correlated between neighbours).
    pub colour: String,
    /// Histogram of |error| in units of its root mean square: upper edge
    /// (powers of two) and part of the values.
    pub histogram: Vec<[f64; 2]>,
    /// Hill's estimate of the tail index of |error|: over 4 is as good as
    /// normal, under 2 means fireflies without a variance.
    pub tail_index: Interval,
    /// Part of the squared error in the worst 0.1 % of the values.
    #[serde(with = "nullable")]
    pub worst_share: f64,
    /// Correlation of the errors of pixels 1, 2, … apart, both axes.
    pub correlation: Vec<f64>,
}

/// How often the true error lies within the reported one.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Calibration {
    /// One per rung.
    pub rungs: Vec<Coverage>,
    /// What the report says of it, one sentence.
    pub verdict: String,
}

/// Coverage at one rung.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Coverage {
    /// The rung.
    pub budget: String,
    /// Its samples per pixel.
    #[serde(with = "nullable")]
    pub samples_per_pixel: f64,
    /// Part of the pixel-channels within 1, 2 and 3 reported standard errors
    /// of the truth (68.3, 95.4, 99.7 % if perfect).
    pub within: [Interval; 3],
    /// The same within 1.96: 95 % if perfect.
    pub within_95: Interval,
    /// Root mean square of the true error ÷ that of the reported one: 1 if
    /// perfect, under 1 conservative.
    #[serde(with = "nullable")]
    pub ratio: f64,
    /// Curve: k, part within k.
    pub curve: Vec<[f64; 2]>,
}

/// A configuration against the baseline, by relMSE of colour.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Comparison {
    /// The configuration.
    pub configuration: String,
    /// Error of the baseline ÷ error of this one, at equal CPU time.
    pub equal_time: Vec<AtLevel>,
    /// Time of the baseline ÷ time of this one, at equal error.
    pub equal_error: Vec<AtLevel>,
    /// Ratio of efficiencies, geometric mean over the common range of time.
    pub overall: Interval,
    /// What the intervals say.
    pub verdict: Preference,
    /// The same in a sentence.
    pub text: String,
}

/// A speed-up at one time or one error.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct AtLevel {
    /// CPU seconds or relMSE.
    #[serde(with = "nullable")]
    pub level: f64,
    /// Above 1 is better than the baseline.
    pub speedup: Interval,
}

/// Outcome of a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Preference {
    /// Better than the baseline.
    Better,
    /// Worse.
    Worse,
    /// No significant difference.
    NoDifference,
    /// They do not measure the same, or share no range.
    NotComparable,
}

/// A picture for the report's viewer.
#[derive(Clone, Debug)]
pub struct Exhibit {
    /// Name of its scene.
    pub scene: String,
    /// As `path, sobol, 64 spp` or `reference`.
    pub label: String,
    /// Columns and rows.
    pub size: [usize; 2],
    /// Interleaved scene-linear RGB, rows from the top.
    pub rgb: Vec<f32>,
}

/// A float that JSON cannot hold is `null`.
pub(super) mod nullable {
    use serde::{Deserialize, Deserializer, Serializer};

    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde's signature")]
    pub fn serialize<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
        if value.is_finite() { to.serialize_f64(*value) } else { to.serialize_none() }
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::NAN))
    }
}

/// The same for lists.
mod nullable_list {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(values: &[f64], to: S) -> Result<S::Ok, S::Error> {
        values.iter().map(|v| v.is_finite().then_some(*v)).collect::<Vec<_>>().serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
        let values = Vec::<Option<f64>>::deserialize(from)?;
        Ok(values.into_iter().map(|v| v.unwrap_or(f64::NAN)).collect())
    }
}
