//! What `--progress` shows, on stderr: bars with the time left, plain lines, or JSON lines. Log lines go above the bars.

use crate::progress::{Silent, Sink};
use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::collections::HashMap;
use std::io::{self, IsTerminal, Write};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Style {
    /// Bars on a terminal, otherwise plain lines
    Auto,
    Plain,
    /// One object a line: node, stage, done, total, seconds_left
    Json,
    /// `openjd_progress: PERCENT` and `openjd_status: TEXT` on stdout
    Openjd,
    None,
}

/// Sets up log lines (`CHIARO_LOG`, warnings unless told otherwise) and returns the sink that shows progress.
pub fn start(style: Style) -> Box<dyn Sink> {
    let bars = (style == Style::Auto && io::stderr().is_terminal())
        .then(|| MultiProgress::with_draw_target(ProgressDrawTarget::stderr_with_hz(10)));
    let log = LogWriter { bars: bars.clone() };
    let filter = tracing_subscriber::EnvFilter::try_from_env("CHIARO_LOG")
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("warn"));
    // A library call may have set up its own already.
    let _ = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(move || log.clone())
        .with_ansi(bars.is_some())
        .with_target(false)
        .without_time()
        .try_init();
    match (style, bars) {
        (Style::None, _) => Box::new(Silent),
        (Style::Openjd, _) => Box::new(Lines::new(openjd_line, Duration::from_millis(500))),
        (Style::Json, _) => Box::new(Lines::new(json_line, Duration::from_millis(100))),
        (_, Some(bars)) => Box::new(Bars { bars, stages: Mutex::default(), next: AtomicU64::new(0) }),
        _ => Box::new(Lines::new(plain_line, Duration::from_secs(1))),
    }
}

#[derive(Clone)]
struct LogWriter {
    bars: Option<MultiProgress>,
}

impl Write for LogWriter {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        match &self.bars {
            Some(bars) => bars.suspend(|| io::stderr().write(line)),
            None => io::stderr().write(line),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}

struct Bars {
    bars: MultiProgress,
    stages: Mutex<HashMap<u64, ProgressBar>>,
    next: AtomicU64,
}

impl Sink for Bars {
    fn begin(&self, node: &str, stage: &str, total: u64) -> u64 {
        let id = self.next.fetch_add(1, Ordering::Relaxed);
        let style = ProgressStyle::with_template("{prefix:>12} {bar:32} {percent:>3} % {msg}, {eta} left")
            .expect("a fixed template")
            .progress_chars("=> ");
        let bar = ProgressBar::new(total).with_style(style).with_prefix(node.to_owned()).with_message(stage.to_owned());
        self.stages.lock().expect("no panic in progress").insert(id, self.bars.add(bar));
        id
    }

    fn advance(&self, stage: u64, steps: u64) {
        if let Some(bar) = self.stages.lock().expect("no panic in progress").get(&stage) {
            bar.inc(steps);
        }
    }

    fn end(&self, stage: u64) {
        if let Some(bar) = self.stages.lock().expect("no panic in progress").remove(&stage) {
            bar.finish_and_clear();
        }
    }
}

/// A stage as lines show it.
struct Shown {
    node: String,
    stage: String,
    done: u64,
    total: u64,
    start: Instant,
    last: Instant,
    last_done: u64,
}

impl Shown {
    fn seconds_left(&self) -> Option<f64> {
        let left = self.total.saturating_sub(self.done) as f64;
        (self.done > 0).then(|| self.start.elapsed().as_secs_f64() * left / self.done as f64)
    }

    fn percent(&self) -> u64 {
        (100 * self.done.min(self.total)).checked_div(self.total).unwrap_or(100)
    }
}

fn plain_line(shown: &Shown) -> String {
    let left = shown.seconds_left().map_or(String::new(), |left| format!(", {left:.0} s left"));
    format!("{}: {} {} %{left}", shown.node, shown.stage, shown.percent())
}

fn json_line(shown: &Shown) -> String {
    serde_json::json!({
        "node": shown.node, "stage": shown.stage, "done": shown.done, "total": shown.total,
        "seconds_left": shown.seconds_left(),
    })
    .to_string()
}

/// Frames are the progress of a task; what else goes on is its status.
fn openjd_line(shown: &Shown) -> String {
    match shown.node == super::render::PROGRESS {
        true => format!("openjd_progress: {}", shown.percent()),
        false => format!("openjd_status: {}", plain_line(shown)),
    }
}

/// A line for each stage that takes longer than `pause`, no more often than that: when a tenth more is done, or much
/// time has gone by.
struct Lines {
    format: fn(&Shown) -> String,
    pause: Duration,
    stages: Mutex<HashMap<u64, Shown>>,
    next: AtomicU64,
}

impl Lines {
    fn new(format: fn(&Shown) -> String, pause: Duration) -> Self {
        Self { format, pause, stages: Mutex::default(), next: AtomicU64::new(0) }
    }

    fn show(&self, shown: &Shown) {
        let line = (self.format)(shown);
        // What an engine listens to is what was asked for.
        let _ = match line.starts_with("openjd_") {
            true => writeln!(io::stdout().lock(), "{line}"),
            false => writeln!(io::stderr().lock(), "{line}"),
        };
    }
}

impl Sink for Lines {
    fn begin(&self, node: &str, stage: &str, total: u64) -> u64 {
        let id = self.next.fetch_add(1, Ordering::Relaxed);
        let now = Instant::now();
        let (node, stage) = (node.to_owned(), stage.to_owned());
        let shown = Shown { node, stage, done: 0, total, start: now, last: now, last_done: 0 };
        self.stages.lock().expect("no panic in progress").insert(id, shown);
        id
    }

    fn advance(&self, stage: u64, steps: u64) {
        let mut stages = self.stages.lock().expect("no panic in progress");
        let Some(shown) = stages.get_mut(&stage) else { return };
        shown.done += steps;
        let since = shown.last.elapsed();
        let much = 10 * (shown.done - shown.last_done) >= shown.total;
        if since >= self.pause && (much || since >= 10 * self.pause) {
            (shown.last, shown.last_done) = (Instant::now(), shown.done);
            self.show(shown);
        }
    }

    fn end(&self, stage: u64) {
        let shown = self.stages.lock().expect("no panic in progress").remove(&stage);
        if let Some(shown) = shown.filter(|shown| shown.start.elapsed() >= self.pause && shown.last_done != shown.done)
        {
            self.show(&shown);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_say_how_far_and_how_long() {
        let start = Instant::now().checked_sub(Duration::from_secs(10)).unwrap();
        let (node, stage) = ("xfer".to_owned(), "rows".to_owned());
        let mut shown = Shown { node, stage, done: 25, total: 100, start, last: start, last_done: 0 };
        assert_eq!(plain_line(&shown), "xfer: rows 25 %, 30 s left");
        let json: serde_json::Value = serde_json::from_str(&json_line(&shown)).unwrap();
        assert!((json["seconds_left"].as_f64().unwrap() - 30.0).abs() < 1.0);
        assert_eq!(openjd_line(&shown), "openjd_status: xfer: rows 25 %, 30 s left");
        shown.node = "render".to_owned();
        assert_eq!(openjd_line(&shown), "openjd_progress: 25");
        shown.node = "xfer".to_owned();
        shown.done = 0;
        shown.total = 0;
        assert_eq!(plain_line(&shown), "xfer: rows 100 %");
    }
}
