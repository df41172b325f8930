//! How far a picture is from another: error metrics, FLIP, and the test
//! whether two noisy pictures have the same mean. How fast accelerators find
//! hits: [`tracing`].
//!
//! Nothing here reads files or prints; pictures are plain slices
//! ([`RgbView`]), reports implement `Display`.

mod flip;
mod image;
mod ledger;
pub mod metrics;
pub mod model;
mod plan;
mod statistics;
pub mod tracing;
mod ztest;

pub use flip::{FlipHdr, flip_hdr, flip_ldr};
pub use image::Image;
pub use ledger::{Ledger, Run};
pub use plan::{Budget, Configuration, Plan, Region, ScenePlan, Seconds, SeriesPlan, Ladder, Vary, scene_name};
pub use metrics::{Metrics, Pair, RgbView, metrics};
pub use ztest::{Failure, Verdict, ZLevel, ZOptions, ZReport, z_test};
