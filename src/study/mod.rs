//! How far a picture is from another, and what that costs: error metrics,
//! FLIP, the test whether two noisy pictures have the same mean; studies of
//! error against run time ([`Plan`] → [`Bench`] → [`gather`] →
//! [`report`]); how fast accelerators find hits ([`tracing`]).
//!
//! [`Bench`], [`Ledger`] and [`report`] read and write files; the statistics
//! between them are functions of pictures and numbers. Nothing prints.

pub mod bench;
pub mod bias;
pub mod conclude;
pub mod coverage;
pub mod figures;
mod flip;
mod gather;
mod image;
pub mod interval;
mod ledger;
pub mod metrics;
pub mod model;
pub mod noise;
mod plan;
pub mod report;
mod series;
mod statistics;
mod table;
pub mod tracing;
pub mod truth;
mod ztest;

pub use bench::{Bench, Watch};
pub use flip::{FlipHdr, flip_hdr, flip_ldr};
pub use gather::{Concluded, gather};
pub use image::Image;
pub use ledger::{Ledger, Run};
pub use metrics::{Metrics, Pair, RgbView, metrics};
pub use plan::{
    Budget, Configuration, Ladder, Name, Plan, Region, ScenePlan, Seconds, SeriesPlan, Vary, scene_name,
};
pub use series::read_series;
pub use statistics::{sidak_level, student_quantile};
pub use table::{summary, to_csv};
pub use ztest::{Failure, Verdict, ZLevel, ZOptions, ZReport, z_test};
