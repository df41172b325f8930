//! Étendue: an offline path tracer that knows how wrong its picture is.
//!
//! A scene file goes through [`load`] into a [`desc`] (plain data with file
//! positions), [`scene`] compiles it to immutable arrays and a plan of what
//! is needed, [`render`] runs an [`integrator`] over tiles into a [`film`],
//! and [`save`] writes it. Rooms import only rooms of lower floors; see
//! `ARCHITECTURE.md`, and `tests/tidy.rs` which checks it.

pub mod accel;
pub mod bsdf;
pub mod camera;
pub mod cli;
pub mod color;
pub mod desc;
pub mod film;
pub mod integrator;
pub mod light;
pub mod load;
pub mod material;
pub mod math;
pub mod medium;
pub mod render;
pub mod sampling;
pub mod save;
pub mod scene;
pub mod selftest;
pub mod shape;
pub mod study;
pub mod texture;
