//! Room `integrator`.
