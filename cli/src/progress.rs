//! Progress on standard error, where that is a terminal and the work takes over a second.

use std::fmt::Display;
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

pub(crate) struct Meter {
    begin: Instant,
    last: Option<Instant>,
    on: bool,
}

/// Silence before the first line, and time between two.
const QUIET: Duration = Duration::from_secs(1);
const PAUSE: Duration = Duration::from_millis(100);

impl Meter {
    pub(crate) fn new() -> Self {
        Self { begin: Instant::now(), last: None, on: std::io::stderr().is_terminal() }
    }

    /// Shows what is running, and how much of it is done, 0 to 1.
    pub(crate) fn show(&mut self, what: impl Display, done: f32) {
        let now = Instant::now();
        let due = self.last.is_none_or(|last| now - last >= PAUSE);
        if self.on && now - self.begin >= QUIET && due {
            self.last = Some(now);
            let mut err = std::io::stderr();
            let percent = (done * 100.0).round();
            // Progress that cannot be shown is no fault of the picture.
            let _ = write!(err, "\r\x1b[K{what} {percent} % ({:.0} s)", (now - self.begin).as_secs_f64());
            let _ = err.flush();
        }
    }

    /// Takes away what is shown.
    pub(crate) fn clear(&mut self) {
        if self.last.take().is_some() {
            let _ = write!(std::io::stderr(), "\r\x1b[K");
        }
    }
}

impl Drop for Meter {
    fn drop(&mut self) {
        self.clear();
    }
}
