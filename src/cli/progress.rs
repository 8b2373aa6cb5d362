//! The progress bar: on a terminal, unless it is not wanted.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::time::Duration;

/// A bar on stderr with the time left, or nothing that can be seen.
pub struct Progress(ProgressBar);

impl Progress {
    /// Hidden with `quiet` or when stderr is no terminal. `what` is a word such as `pixels`.
    pub fn new(what: &'static str, quiet: bool) -> Self {
        let target = match !quiet && std::io::stderr().is_terminal() {
            true => ProgressDrawTarget::stderr_with_hz(10),
            false => ProgressDrawTarget::hidden(),
        };
        let style = "{percent:>3} % of {len} {msg} [{wide_bar}] {elapsed} gone, {eta} left";
        let style = ProgressStyle::with_template(style).expect("the template is constant and tested");
        let bar = ProgressBar::with_draw_target(None, target).with_style(style).with_message(what);
        if !bar.is_hidden() {
            // Keeps the clock moving while a slow tile is at work.
            bar.enable_steady_tick(Duration::from_millis(500));
        }
        Self(bar)
    }

    /// `done` of `total`; cheap enough for every tile, from any thread.
    pub fn set(&self, done: usize, total: usize) {
        self.0.set_length(total as u64);
        self.0.set_position(done as u64);
    }

    /// Takes the bar off the screen.
    pub fn finish(self) {
        self.0.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quiet_bar_counts_and_shows_nothing() {
        let progress = Progress::new("pixels", true);
        progress.set(3, 10);
        assert_eq!((progress.0.position(), progress.0.length(), progress.0.is_hidden()), (3, Some(10), true));
        progress.finish();
    }
}
