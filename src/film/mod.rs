//! Room `film`.
