//! Room `color`.
