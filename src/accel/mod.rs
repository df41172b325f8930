//! Room `accel`.
