//! How far a picture is from another: error metrics, FLIP, and the test
//! whether two noisy pictures have the same mean. How fast accelerators find
//! hits: [`tracing`]. A whole study as a page to read: [`report`].
//!
//! Nothing here reads files or prints, and only [`report`] writes them;
//! pictures are plain slices ([`RgbView`]), reports implement `Display`.

mod flip;
pub mod metrics;
pub mod model;
pub mod report;
mod statistics;
pub mod tracing;
mod ztest;

pub use flip::{FlipHdr, flip_hdr, flip_ldr};
pub use metrics::{Metrics, Pair, RgbView, metrics};
pub use ztest::{Failure, Verdict, ZLevel, ZOptions, ZReport, z_test};
