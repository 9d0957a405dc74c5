//! The bar: one line on a terminal, nothing in a pipe.

use super::estimate::{Estimate, within_time};
use super::failure::say;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use lightkiln::options::{BakeOptions, Goal, LightOptions};
use lightkiln::progress::{Observer, Stage};
use lightkiln::text;
use std::io::IsTerminal as _;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Parts the bar is divided into.
const STEPS: u64 = 1000;
const REDRAW: Duration = Duration::from_millis(100);

/// How much is printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verbosity {
    /// Errors only.
    Quiet,
    /// A bar and a summary.
    Normal,
    /// Everything.
    Verbose,
}

/// Listens to a bake and shows how far it is. Dropping it takes the bar away.
pub struct Display {
    shared: Arc<Shared>,
    painter: Option<Painter>,
}

/// The thread that draws, so that workers only store numbers.
struct Painter {
    stop: Sender<()>,
    thread: JoinHandle<()>,
}

/// What the workers write and the painter reads.
struct Shared {
    start: Instant,
    lines: bool,
    estimate: Mutex<Estimate>,
    goal: Goal,
    pass: AtomicUsize,
    stage: Mutex<Option<Stage>>,
    done: AtomicU64,
    total: AtomicU64,
    unshot_bits: AtomicU64,
    /// What the light so far is off by.
    error_bits: AtomicU64,
    /// What is finished of this pass usually is off by.
    usual_error_bits: AtomicU64,
    stopping: AtomicBool,
}

impl Display {
    /// A bar if standard error is a terminal; a line per stage if it is not and `verbosity` asks for everything.
    pub fn new(verbosity: Verbosity, options: &BakeOptions) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let shared = Arc::new(Shared {
            start: Instant::now(),
            lines: verbosity == Verbosity::Verbose && !terminal,
            estimate: Mutex::new(Estimate::new(&options.light)),
            goal: options.goal,
            pass: AtomicUsize::new(1),
            stage: Mutex::new(None),
            done: AtomicU64::new(0),
            total: AtomicU64::new(0),
            unshot_bits: AtomicU64::new(f64::NAN.to_bits()),
            error_bits: AtomicU64::new(f64::NAN.to_bits()),
            usual_error_bits: AtomicU64::new(0_f64.to_bits()),
            stopping: AtomicBool::new(false),
        });
        let visible = terminal && verbosity >= Verbosity::Normal;
        let painter = visible.then(|| Painter::start(Arc::clone(&shared))).flatten();
        Self { shared, painter }
    }

    /// Seconds since the start.
    pub fn seconds(&self) -> f64 {
        self.shared.seconds()
    }

    /// What tells the user that the bake was asked to stop.
    pub fn on_interrupt(&self, verbosity: Verbosity) -> impl Fn() + Send + 'static {
        let shared = Arc::clone(&self.shared);
        let line = self.painter.is_none() && verbosity >= Verbosity::Normal;
        move || {
            shared.stopping.store(true, Ordering::Relaxed);
            if line {
                say("interrupted: writing the solution so far; interrupt again to quit at once");
            }
        }
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        if let Some(Painter { stop, thread }) = self.painter.take() {
            drop(stop);
            let _ = thread.join();
        }
    }
}

impl Observer for Display {
    fn stage(&self, stage: Stage) {
        let shared = &self.shared;
        let now_s = shared.seconds();
        lock(&shared.estimate).begin(stage, now_s);
        shared.done.store(0, Ordering::Relaxed);
        shared.total.store(0, Ordering::Relaxed);
        shared.unshot_bits.store(f64::NAN.to_bits(), Ordering::Relaxed);
        let before = lock(&shared.stage).replace(stage);
        if shared.lines && before != Some(stage) {
            say(&format!("{now_s:8.2} s  {}", stage.name()));
        }
    }

    fn advance(&self, _stage: Stage, done: u64, total: u64) {
        self.shared.done.store(done, Ordering::Relaxed);
        self.shared.total.store(total, Ordering::Relaxed);
    }

    fn unshot(&self, fraction: f64) {
        self.shared.unshot_bits.store(fraction.to_bits(), Ordering::Relaxed);
    }

    fn pass(&self, number: usize, effort: &LightOptions, usual_error: f64) {
        let shared = &self.shared;
        shared.pass.store(number, Ordering::Relaxed);
        shared.usual_error_bits.store(usual_error.to_bits(), Ordering::Relaxed);
        lock(&shared.estimate).pass(number, effort, shared.seconds());
    }

    fn unfinished(&self, share: f64) {
        let usual = f64::from_bits(self.shared.usual_error_bits.load(Ordering::Relaxed));
        self.shared.error_bits.store(share.hypot(usual).to_bits(), Ordering::Relaxed);
    }

    fn error(&self, share: f64) {
        let shared = &self.shared;
        shared.error_bits.store(share.to_bits(), Ordering::Relaxed);
        if shared.lines {
            say(&format!("{:8.2} s  error about {}", shared.seconds(), text::percent(share)));
        }
    }
}

impl Shared {
    fn seconds(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    fn draw(&self, bar: &ProgressBar) {
        let (done, total) = (self.done.load(Ordering::Relaxed), self.total.load(Ordering::Relaxed));
        let stage_share = if total > 0 { done as f64 / total as f64 } else { 0.0 };
        let standing = lock(&self.estimate).at(self.seconds(), stage_share);
        let unshot = f64::from_bits(self.unshot_bits.load(Ordering::Relaxed));
        let error = f64::from_bits(self.error_bits.load(Ordering::Relaxed));
        let standing = match self.goal {
            Goal::Effort | Goal::Tolerance(_) => standing,
            Goal::Seconds(seconds) => within_time(self.seconds(), seconds),
        };

        let stage = *lock(&self.stage);
        let mut message = stage.map_or("", Stage::name).to_owned();
        let pass = self.pass.load(Ordering::Relaxed);
        if pass > 1 {
            message = format!("pass {pass}: {message}");
        }
        if unshot.is_finite() {
            message += &format!(", {} unshot", text::percent(unshot));
        }
        if error.is_finite() {
            message += &format!(", error about {}", text::percent(error));
        }
        if self.stopping.load(Ordering::Relaxed) {
            message += ", stopping: the solution so far is written";
        } else if let Some(left_s) = standing.left_s {
            message += &format!(", {} left", clock(left_s));
        }
        bar.set_message(message);
        bar.set_position((standing.share * STEPS as f64) as u64);
        bar.tick();
    }
}

impl Painter {
    fn start(shared: Arc<Shared>) -> Option<Self> {
        let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr());
        if let Ok(style) = ProgressStyle::with_template("{bar:30} {percent:>3} %  {msg}") {
            bar.set_style(style.progress_chars("━╸─"));
        }
        let (stop, stopped) = mpsc::channel::<()>();
        let paint = move || {
            while stopped.recv_timeout(REDRAW) == Err(RecvTimeoutError::Timeout) {
                shared.draw(&bar);
            }
            bar.finish_and_clear();
        };
        let thread = std::thread::Builder::new().name("progress".to_owned()).spawn(paint).ok()?;
        Some(Self { stop, thread })
    }
}

/// Whole minutes and seconds; steadier to look at than fractions.
fn clock(seconds: f64) -> String {
    let whole = seconds.ceil() as u64;
    if whole < 3600 {
        format!("{}:{:02}", whole / 60, whole % 60)
    } else {
        format!("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60)
    }
}

/// A worker that panicked while it held the lock left nothing half done.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
