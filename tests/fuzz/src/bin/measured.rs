//! The target `measured` of `readers.rs`.
#![no_main]

use etendue_fuzz::readers::measured as reader;

libfuzzer_sys::fuzz_target!(init: etendue_fuzz::prepare(reader), |data: &[u8]| etendue_fuzz::run(reader, data));
