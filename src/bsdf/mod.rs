//! Room `bsdf`.
