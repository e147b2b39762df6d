//! A thread that does the newest of what it is asked for; what waited before is forgotten.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

pub struct Latest<Job, Answer> {
    jobs: Option<Sender<Job>>,
    answers: Receiver<Answer>,
    thread: Option<JoinHandle<()>>,
}

impl<Job: Send + 'static, Answer: Send + 'static> Latest<Job, Answer> {
    /// `work` is done on the thread; what it gives is kept until it is asked for.
    pub fn new(
        name: &str,
        mut work: impl FnMut(Job) -> Option<Answer> + Send + 'static,
        wake: impl Fn() + Send + 'static,
    ) -> Self {
        let (jobs, asked) = channel::<Job>();
        let (sender, answers) = channel();
        let serve = move || {
            while let Ok(first) = asked.recv() {
                let newest = asked.try_iter().last().unwrap_or(first);
                let Some(answer) = work(newest) else { continue };
                if sender.send(answer).is_err() {
                    return;
                }
                wake();
            }
        };
        let thread = std::thread::Builder::new().name(name.to_owned()).spawn(serve).ok();
        Self { jobs: Some(jobs), answers, thread }
    }

    pub fn ask(&self, job: Job) {
        if let Some(jobs) = &self.jobs {
            let _ = jobs.send(job);
        }
    }

    /// The newest since it was last asked.
    pub fn answer(&self) -> Option<Answer> {
        self.answers.try_iter().last()
    }
}

impl<Job, Answer> Drop for Latest<Job, Answer> {
    /// What was asked for last is done first.
    fn drop(&mut self) {
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
