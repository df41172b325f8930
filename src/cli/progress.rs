//! The progress bar (or plain lines when stderr is no terminal) and Ctrl-C.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Once};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::render::Monitor;

/// Ctrl-C has been pressed this often.
static INTERRUPTS: AtomicU32 = AtomicU32::new(0);
static HANDLER: Once = Once::new();

/// From now on Ctrl-C is counted ([`interrupted`]); the second one quits.
pub fn catch_interrupts() {
    HANDLER.call_once(|| {
        // Where no handler can be set, Ctrl-C ends the program as usual.
        let _ = ctrlc::set_handler(|| {
            if INTERRUPTS.fetch_add(1, Ordering::SeqCst) > 0 {
                std::process::exit(130);
            }
        });
    });
}

/// True once Ctrl-C has been pressed.
pub fn interrupted() -> bool {
    INTERRUPTS.load(Ordering::SeqCst) > 0
}

/// A bar of a thousand steps; nothing where stderr is no terminal.
pub fn new_bar(quiet: bool) -> Option<ProgressBar> {
    (!quiet && std::io::stderr().is_terminal()).then(|| {
        let bar = ProgressBar::new(1000);
        if let Ok(style) = ProgressStyle::with_template("{bar:32} {percent:>3} %  {msg}") {
            bar.set_style(style);
        }
        bar
    })
}

/// Shows how far a render is.
pub struct Progress {
    bar: Option<ProgressBar>,
    plain: bool,
    start: Instant,
    time_limit: Option<Duration>,
    unlimited: bool,
    next_line: Arc<AtomicU64>,
    announced: AtomicBool,
}

impl Progress {
    /// A bar for a render that ends after `time_limit` at the latest;
    /// `unlimited` when the number of samples is no limit.
    pub fn new(quiet: bool, time_limit: Option<Duration>, unlimited: bool) -> Progress {
        catch_interrupts();
        let bar = new_bar(quiet);
        Progress {
            plain: !quiet && bar.is_none(),
            bar,
            start: Instant::now(),
            time_limit,
            unlimited,
            next_line: Arc::new(AtomicU64::new(10)),
            announced: AtomicBool::new(false),
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    /// Share done and seconds left, by samples or by time, whichever ends first.
    fn left(&self, done: u64, total: u64) -> (f64, f64) {
        let elapsed = self.start.elapsed().as_secs_f64();
        let share = if self.unlimited { 0.0 } else { done as f64 / total as f64 };
        let mut best = (share, if share > 0.0 { elapsed / share - elapsed } else { f64::INFINITY });
        if let Some(limit) = self.time_limit {
            let limit = limit.as_secs_f64();
            if limit - elapsed < best.1 {
                best = ((elapsed / limit).min(1.0), (limit - elapsed).max(0.0));
            }
        }
        best
    }
}

impl Monitor for Progress {
    fn progress(&self, done: u64, total: u64, error: Option<f64>) {
        if self.bar.is_none() && !self.plain {
            return;
        }
        let (share, left) = self.left(done, total);
        let left = if left.is_finite() { format!("{left:.0} s left") } else { "no limit".to_owned() };
        let error = error.map_or(String::new(), |e| format!(", error {:.2} %", e * 100.0));
        if let Some(bar) = &self.bar {
            bar.set_position((share * 1000.0) as u64);
            bar.set_message(format!("{left}{error}"));
        } else {
            // A line after 10 s, then ever more rarely.
            let elapsed = self.start.elapsed().as_secs();
            let due = self.next_line.load(Ordering::Relaxed);
            let next = due + (due / 2).max(10);
            let turn = Ordering::Relaxed;
            if elapsed >= due && self.next_line.compare_exchange(due, next, turn, turn).is_ok() {
                say!("{:.0} % done, {left}{error}", share * 100.0);
            }
        }
    }

    fn stop(&self) -> bool {
        let stop = interrupted();
        if stop && !self.announced.swap(true, Ordering::Relaxed) {
            let text = "interrupted: writing what there is (Ctrl-C again quits at once)";
            match &self.bar {
                Some(bar) => bar.println(text),
                None => say!("{text}"),
            }
        }
        stop
    }
}
