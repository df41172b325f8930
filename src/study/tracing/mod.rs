//! How fast accelerators find hits, and whether they find the same: what
//! `etendue accel` runs.
//!
//! A [`Subject`] (a scene, or a mesh and where to look at it from) gives
//! [`RaySet`]s, which are pure functions of a seed and the same for every
//! [`Contender`]. [`measure`] builds each contender and traces each set, in
//! interleaved repeats on one thread and in CPU time, so that a loaded machine
//! slows all of them alike; ratios are taken within a repeat.

mod contender;
mod generate;
mod measure;
mod rays;
mod report;
mod subject;

pub use contender::{Contender, Tracer};
pub use generate::{displaced, stadium};
pub use measure::{BuildTimes, CaseResult, Differences, KindResult, Options, SetResult, measure};
pub use rays::{RaySet, Rays, Spawn, ray_sets};
pub use report::{Estimate, Report};
pub use subject::{Subject, View};
