//! Riding out the absence of a server.

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use tokio::sync::watch;
use tonic::{Code, Status};

use crate::error::{Error, Kind};
use crate::shared::{reconnect, retries};

/// Whether the server, or the way to it, was lost, so that the same call may succeed later. What a
/// server drops arrives as CANCELLED where this side cancelled nothing.
fn is_transient(status: &Status) -> bool {
    // A connection that breaks in the middle of a message is the transport's error, of any code.
    matches!(status.code(), Code::Unavailable | Code::Cancelled)
        || std::error::Error::source(status).is_some()
}

/// What the calls and streams of one client share.
pub struct Patience {
    pub give_up: Duration,
    /// Why the server will not come back, if that is known.
    pub hopeless: Box<dyn Fn() -> Option<Error> + Send + Sync>,
    pub on_outage: Box<dyn Fn(&str) + Send + Sync>,
    /// Something was heard of the server: it was there.
    pub reached: AtomicBool,
}

/// A flag that tasks can wait for.
#[derive(Clone, Debug)]
pub struct Flag(watch::Sender<bool>);

impl Default for Flag {
    fn default() -> Self {
        Flag(watch::Sender::new(false))
    }
}

impl Flag {
    pub fn set(&self) {
        self.0.send_replace(true);
    }

    pub fn is_set(&self) -> bool {
        *self.0.borrow()
    }

    pub async fn wait(&self) {
        // It cannot be closed while this end of it is there.
        let _ = self.0.subscribe().wait_for(|&set| set).await;
    }
}

/// The attempts at one call or stream. A quiet one leaves it to others to report an outage.
pub struct Outage<'a> {
    patience: &'a Patience,
    quiet: bool,
    pub stopped: Flag,
    attempts: u32,
    /// Attempts since a reply was lost, where no server is waited for.
    repeats: u32,
    lost_at: Instant,
}

/// A pause that is shortened at random: the clients of a server that comes back do not come all together.
fn shortened(pause: Duration, jitter: f64) -> Duration {
    let chance = RandomState::new().build_hasher().finish() as f64 / u64::MAX as f64;
    pause.mul_f64(1.0 - jitter * chance)
}

impl<'a> Outage<'a> {
    pub fn new(patience: &'a Patience, quiet: bool, stopped: Flag) -> Self {
        Outage { patience, quiet, stopped, attempts: 0, repeats: 0, lost_at: Instant::now() }
    }

    /// Whether the attempt under way follows on one that was broken off.
    pub fn lasts(&self) -> bool {
        self.attempts > 0
    }

    /// Whether an attempt before this one may have done what was asked.
    pub fn repeats(&self) -> bool {
        self.attempts + self.repeats > 0
    }

    /// The attempt brought something: the server is there.
    pub fn heard(&mut self) {
        self.patience.reached.store(true, Ordering::Relaxed);
        self.repeats = 0;
        if self.attempts > 0 {
            let seconds = self.lost_at.elapsed().as_secs_f64();
            self.tell(&format!("the server is back after {seconds:.1} s"));
            self.attempts = 0;
        }
    }

    fn tell(&self, said: &str) {
        if !self.quiet {
            (self.patience.on_outage)(said);
        }
    }

    /// Ok when it is time for another attempt.
    pub async fn wait(&mut self, status: &Status) -> Result<(), Error> {
        let mut ours = Error::from_status(status);
        if ours.kind == Kind::MeshNotFound && self.lasts() {
            let message =
                "the server went away and came back without the mesh; it keeps meshes only with --data-dir";
            return Err(Error::new(Kind::Unavailable, &ours.reason, message));
        }
        if !is_transient(status) {
            return Err(ours);
        }
        if let Some(hopeless) = (self.patience.hopeless)() {
            return Err(hopeless);
        }
        if ours.kind == Kind::Other {
            ours.kind = Kind::Unavailable;
        }
        if &*ours.reason == "SHUTTING_DOWN" {
            self.patience.reached.store(true, Ordering::Relaxed); // said by a server
        }
        if self.stopped.is_set() {
            return Err(ours);
        }
        let most = self.patience.give_up;
        if most.is_zero() || !self.patience.reached.load(Ordering::Relaxed) {
            return self.repeat(ours).await;
        }
        if self.attempts == 0 {
            self.lost_at = Instant::now();
            self.tell(&format!("lost the server ({ours}): trying again for up to {most:?}"));
        }
        let gone = self.lost_at.elapsed();
        if gone >= most {
            if self.attempts > 0 {
                ours.message += &format!("; waited {:.1} s for it", gone.as_secs_f64());
            }
            return Err(ours);
        }
        let longer = reconnect::PAUSE_GROWTH.powf(f64::from(self.attempts));
        let full = Duration::from_secs_f64((reconnect::FIRST_PAUSE * longer).min(reconnect::LONGEST_PAUSE));
        self.attempts += 1;
        self.pause(shortened(full, reconnect::PAUSE_JITTER).min(most - gone), ours).await
    }

    /// Where no server is waited for, its reply may still have been lost on the way: a few attempts within a
    /// second, as gRPC's other libraries make them by the same numbers.
    async fn repeat(&mut self, ours: Error) -> Result<(), Error> {
        if f64::from(self.repeats + 1) >= retries::MAX_ATTEMPTS {
            return Err(ours);
        }
        let longer = retries::BACKOFF_MULTIPLIER.powf(f64::from(self.repeats));
        let full = Duration::from_secs_f64((retries::INITIAL_BACKOFF * longer).min(retries::MAX_BACKOFF));
        self.repeats += 1;
        self.pause(shortened(full, reconnect::PAUSE_JITTER), ours).await
    }

    /// Ok after that time, unless it is stopped before.
    async fn pause(&self, time: Duration, ours: Error) -> Result<(), Error> {
        tokio::select! {
            () = self.stopped.wait() => Err(ours),
            () = tokio::time::sleep(time) => Ok(()),
        }
    }
}
