//! Sequences, warps, tables and the weights of multiple importance sampling.
//!
//! [`Sampler`] hands out uniform numbers as a pure function of (seed, pixel,
//! sample index, dimension); the warps turn them into directions and points;
//! [`AliasTable`] picks one of many, [`SquareTable`] a place in a picture,
//! [`SlicedSquare`] one by a density that changes with two parameters; [`power_heuristic`] weighs estimators.

mod alias;
mod mis;
mod replicas;
mod sampler;
mod slices;
mod sobol;
mod square;
mod warp;

pub use alias::{AliasSample, AliasTable};
pub use mis::{balance_heuristic, power_heuristic};
pub use replicas::replica_of;
pub use sampler::{Sampler, Sequence};
pub use slices::{Blend, Cell, SlicedSquare};
pub use square::{Raster, SquareTable, invert_linear};
pub use warp::{
    UNIFORM_SPHERE_PDF, concentric_disk, cosine_hemisphere, cosine_hemisphere_pdf, disk_to_square,
    triangle_to_square, uniform_cone, uniform_cone_pdf, uniform_sphere, uniform_triangle,
};
