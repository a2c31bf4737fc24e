//! What every verb carries: progress, cancellation, a memory budget and a thread pool of its own.

use crate::error::{Error, Fault, Result};
use std::fmt;
use std::sync::Arc;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

/// How far a verb is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// What is being done: `load`, `prepare`, `render`, `encode`, ...
    pub stage: &'static str,
    /// How much of the stage is done.
    pub done: u64,
    /// How much there is; 0 when unknown.
    pub total: u64,
}

type Callback = dyn Fn(Progress) + Send + Sync;

/// The budget, the pool and the cancel flag of one piece of work. Clones share all of them.
#[derive(Clone)]
pub struct Job(Arc<Inner>);

struct Inner {
    threads: usize,
    memory: u64,
    held: AtomicU64,
    peak: AtomicU64,
    cancelled: Arc<AtomicBool>,
    callback: Option<Box<Callback>>,
    pool: OnceLock<rayon::ThreadPool>,
}

/// What a [`Job`] is made from.
#[derive(Default)]
pub struct JobBuilder {
    threads: usize,
    memory: Option<u64>,
    cancelled: Arc<AtomicBool>,
    callback: Option<Box<Callback>>,
}

impl JobBuilder {
    /// Number of threads; 0 means one per core. Results do not depend on it.
    pub fn threads(mut self, n: usize) -> Self {
        self.threads = n;
        self
    }
    /// Most bytes that the work may hold at once; work that needs more ends with [`Fault::Memory`].
    pub fn memory(mut self, bytes: u64) -> Self {
        self.memory = Some(bytes);
        self
    }
    /// A flag that, once true, makes the work end with [`Fault::Interrupted`] soon.
    pub fn cancel_flag(mut self, flag: Arc<AtomicBool>) -> Self {
        self.cancelled = flag;
        self
    }
    /// Called, from any thread, whenever a stage moves on. Must be quick.
    pub fn on_progress(mut self, f: impl Fn(Progress) + Send + Sync + 'static) -> Self {
        self.callback = Some(Box::new(f));
        self
    }
    /// The job.
    pub fn build(self) -> Job {
        let threads = match self.threads {
            0 => std::thread::available_parallelism().map_or(1, |n| n.get()),
            n => n,
        };
        Job(Arc::new(Inner {
            threads,
            memory: self.memory.unwrap_or(u64::MAX),
            held: AtomicU64::new(0),
            peak: AtomicU64::new(0),
            cancelled: self.cancelled,
            callback: self.callback,
            pool: OnceLock::new(),
        }))
    }
}

impl Default for Job {
    fn default() -> Self {
        JobBuilder::default().build()
    }
}

impl fmt::Debug for Job {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Job").field("threads", &self.0.threads).field("memory", &self.0.memory).finish_non_exhaustive()
    }
}

impl Job {
    /// A job with other than default settings.
    pub fn builder() -> JobBuilder {
        JobBuilder::default()
    }
    /// How many threads [`Job::run`] uses.
    pub fn threads(&self) -> usize {
        self.0.threads
    }
    /// Asks the work to stop.
    pub fn cancel(&self) {
        self.0.cancelled.store(true, Relaxed);
    }
    /// Whether the work was asked to stop.
    pub fn is_cancelled(&self) -> bool {
        self.0.cancelled.load(Relaxed)
    }
    /// An [`Fault::Interrupted`] error once the work was asked to stop.
    pub fn check(&self) -> Result<()> {
        if self.is_cancelled() { Err(Error::new(Fault::Interrupted, "job.interrupted", "interrupted")) } else { Ok(()) }
    }
    /// Reports progress.
    pub fn progress(&self, stage: &'static str, done: u64, total: u64) {
        if let Some(f) = &self.0.callback {
            f(Progress { stage, done, total });
        }
    }
    /// Asks for `bytes` *before* they are allocated; they are given back when the reservation is dropped.
    /// `what` completes the sentence "there is no room for ...".
    ///
    /// # Errors
    /// [`Fault::Memory`] when the budget does not hold them.
    pub fn reserve(&self, bytes: u64, what: impl fmt::Display) -> Result<Reservation> {
        let held = self.0.held.fetch_add(bytes, Relaxed).saturating_add(bytes);
        if held > self.0.memory {
            self.0.held.fetch_sub(bytes, Relaxed);
            return Err(Error::new(
                Fault::Memory,
                "job.memory",
                format!(
                    "no room for {what}: it needs {:.1} MiB, and {:.1} of {:.1} MiB are in use",
                    mebibytes(bytes),
                    mebibytes(held - bytes),
                    mebibytes(self.0.memory)
                ),
            )
            .remedy("allow more with --max-memory, or ask for less"));
        }
        self.0.peak.fetch_max(held, Relaxed);
        Ok(Reservation { job: self.clone(), bytes })
    }
    /// The most bytes that were reserved at once.
    pub fn peak(&self) -> u64 {
        self.0.peak.load(Relaxed)
    }
    /// Runs `f` where rayon's parallel iterators and `join` use this job's threads.
    pub fn run<R: Send>(&self, f: impl FnOnce() -> R + Send) -> R {
        let pool = self.0.pool.get_or_init(|| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(self.0.threads)
                .thread_name(|k| format!("frieze-{k}"))
                .build()
                .expect("the system can start a thread")
        });
        pool.install(f)
    }
}

fn mebibytes(bytes: u64) -> f64 {
    bytes as f64 / 1_048_576.0
}

/// Reserved memory of a [`Job`]; dropping it gives the bytes back.
#[derive(Debug)]
pub struct Reservation {
    job: Job,
    bytes: u64,
}

impl Drop for Reservation {
    fn drop(&mut self) {
        self.job.0.held.fetch_sub(self.bytes, Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_budget_is_asked_before_and_given_back_after() {
        let job = Job::builder().memory(100).build();
        let first = job.reserve(60, "a").unwrap();
        assert_eq!(job.reserve(60, "b").unwrap_err().fault, Fault::Memory);
        drop(first);
        job.reserve(60, "c").unwrap();
        assert_eq!(job.peak(), 60);
    }

    #[test]
    fn cancelling_any_clone_stops_all() {
        let job = Job::default();
        job.clone().cancel();
        assert_eq!(job.check().unwrap_err().fault.exit_code(), 130);
    }
}
