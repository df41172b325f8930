//! What several test files share.

pub mod chi2;
