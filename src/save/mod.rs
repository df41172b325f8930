//! Room `save`.
