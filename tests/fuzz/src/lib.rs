//! What all fuzz targets share: how a panic, an execution that takes too long
//! and one that takes too much memory become failures.

use std::cell::RefCell;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::sync::OnceLock;
use std::time::Duration;

use cap::Cap;
use cpu_time::ProcessTime;

#[path = "../../common/readers.rs"]
pub mod readers;

/// CPU time of one execution, of all threads: a loaded machine does not matter.
const CPU: Duration = Duration::from_secs(1);
/// Bytes allocated at any one time. libFuzzer's own do not count: they do not
/// come from this allocator.
const MEMORY: usize = 1 << 30;

/// Counts what is allocated. Refuses only what no machine has.
#[global_allocator]
static ALLOCATOR: Cap<std::alloc::System> = Cap::new(std::alloc::System, 16 * MEMORY);

/// Where the input stands while it is executed, after its length: what
/// overflows the stack leaves no time to write it down.
static LAST: OnceLock<File> = OnceLock::new();

thread_local! {
    /// Message and place of the last panic.
    static PANIC: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Once before the first execution: one thread, so that coverage is the same
/// each time; a panic that is caught, as a decoder's may be, is none; and what
/// is made at first use is made.
pub fn prepare(reader: readers::Reader) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
    pool.unwrap_or_else(|e| fail(&format!("no thread pool: {e}")));
    std::panic::set_hook(Box::new(|info| {
        let trace = std::backtrace::Backtrace::capture();
        PANIC.with_borrow_mut(|text| *text = format!("{info}\n{trace}"));
    }));
    if let Some(path) = std::env::var_os("ETENDUE_FUZZ_LAST") {
        let file = File::create(path).unwrap_or_else(|e| fail(&format!("no place for inputs: {e}")));
        LAST.get_or_init(|| file);
    }
    reader(&[]);
}

/// One execution.
pub fn run(reader: readers::Reader, data: &[u8]) {
    if let Some(last) = LAST.get() {
        let whole = [&(data.len() as u32).to_ne_bytes(), data].concat();
        last.write_all_at(&whole, 0).unwrap_or_else(|e| fail(&format!("cannot keep an input: {e}")));
    }
    let start = ProcessTime::now();
    if std::panic::catch_unwind(|| reader(data)).is_err() {
        fail(&PANIC.with_borrow(Clone::clone));
    }
    let taken = start.elapsed();
    if taken > CPU {
        fail(&format!("it takes {taken:?} of CPU time, more than {CPU:?}"));
    }
    let most = ALLOCATOR.max_allocated();
    if most > MEMORY {
        fail(&format!("{most} bytes are allocated at once, more than {MEMORY}"));
    }
}

fn fail(why: &str) -> ! {
    eprintln!("FINDING: {why}");
    std::process::abort()
}
