//! Room `texture`.
