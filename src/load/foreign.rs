//! Decoders of other packages: what they promise is held against the size of
//! the file before they allocate it, and a panic of theirs is an error.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// What a decoded file may take in bytes however small it is.
const FREE: u64 = 64 << 20;

/// Runs a decoder. Bugs of decoders are found by broken files, and no file may
/// end the program.
pub fn guarded<T>(decode: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(decode))
        .unwrap_or_else(|_| Err("its decoder gave up: the file is broken, or of a kind not foreseen".into()))
}

/// Fails when a file of `length` bytes cannot hold what decodes to `promised`
/// bytes, where one byte of its format stands for at most `ratio`.
pub fn check_promise(promised: u64, length: usize, ratio: u64) -> Result<(), String> {
    if promised <= FREE.max(ratio.saturating_mul(length as u64)) {
        return Ok(());
    }
    Err(format!("its header promises {promised} bytes of pixels, which {length} bytes cannot hold"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panics_are_errors() {
        assert_eq!(guarded(|| Ok(3)), Ok(3));
        assert_eq!(guarded(|| Err::<(), _>("no".into())), Err("no".into()));
        let nothing: [u8; 0] = [];
        assert!(guarded(|| Ok(nothing[std::hint::black_box(1)])).unwrap_err().contains("gave up"));
    }

    #[test]
    fn promises() {
        assert!(check_promise(FREE, 1, 1).is_ok());
        assert!(check_promise(FREE + 1, 1, 1000).is_err());
        assert!(check_promise(FREE + 1, 1 << 20, 1000).is_ok());
    }
}
