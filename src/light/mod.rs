//! Room `light`.
