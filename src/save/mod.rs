//! Film to files: OpenEXR for work, PNG to look at.
//!
//! A file is written under its name with `.part` added, flushed to the disk
//! and then renamed: whatever goes wrong, a file of that name is a whole one,
//! and the one that was there before stays until then. What would go wrong at
//! the end is asked before the work begins ([`check_writable`],
//! [`check_distinct`]).

mod exr_order;
mod file;
mod openexr;
mod png;
mod tone;

pub use file::{check_distinct, check_writable, write_file};
pub use openexr::{Header, Options, Saturated, write_exr};
pub use png::write_png;
pub use tone::{Curve, Tone};
