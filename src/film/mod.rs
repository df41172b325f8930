//! Pixel sums, their groups and layers.
//!
//! A pass renders tiles: each [`Tile`] weighs samples into all pixels that the
//! reconstruction [`Filter`] covers, in f64 and in a fixed order. Then
//! [`Film::merge`] rounds each of its sums once to fixed point and adds it to
//! the film. Integer addition is associative, so that the film has the same
//! bits for every number of threads and order of tiles; and it does not drift:
//! a constant pixel keeps its value at any number of samples.
//!
//! A pixel is Σ w·L / Σ w over all samples within the filter's reach,
//! separately in groups of the samples ([`Groups`]: two halves, or independent
//! replicas), whose differences tell the error of the pixel (layer `error`) and
//! of the picture ([`Film::relative`]).

mod estimate;
mod filter;
mod groups;
mod layers;
mod rect;
mod relative;
mod scale;
mod spec;
mod sums;
mod tile;
mod wide;

pub use filter::Filter;
pub use groups::{Groups, MAX_REPLICAS};
pub use layers::{LayerSet, PixelSample};
pub use rect::Rect;
pub use relative::RelativeError;
pub use scale::Scale;
pub use spec::FilmSpec;
pub use sums::{Channel, Film, Picture, TILE_SIZE};
pub use tile::Tile;
