//! Showing a mesh at work.

use std::io::{stderr, IsTerminal, Write};
use std::time::{Duration, Instant};

use crate::proto::{Phase, Progress};

/// An `on_progress` that keeps one live line on a terminal, and else prints few plain lines.
pub fn progress_bar() -> Box<dyn FnMut(&Progress)> {
    let live = stderr().is_terminal();
    let pause = Duration::from_millis(if live { 50 } else { 5000 });
    let mut shown: Option<(Phase, Instant)> = None;
    Box::new(move |progress| {
        let phase = progress.phase();
        if shown.is_some_and(|(before, at)| before == phase && at.elapsed() < pause) {
            return;
        }
        shown = Some((phase, Instant::now()));
        let name = phase.as_str_name().trim_start_matches("PHASE_").to_lowercase();
        let line = format!(
            "{name} {:3.0}%  {} vertices  {} simplices  {:.1} s",
            100.0 * progress.fraction,
            progress.vertices,
            progress.simplices,
            progress.elapsed_seconds
        );
        let (before, after) = match (live, phase) {
            (false, _) => ("", "\n"),
            (true, Phase::Done) => ("\r", "\x1b[K\n"),
            (true, _) => ("\r", "\x1b[K"),
        };
        let _ = write!(stderr(), "{before}{line}{after}"); // which may be closed
    })
}
