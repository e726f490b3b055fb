//! A worker: a ServeOracle stream, on which the server asks and an oracle answers.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::mpsc;
use tokio_stream::wrappers::UnboundedReceiverStream;
use tonic::Status;

use crate::client::Client;
use crate::error::{Error, Kind};
use crate::oracle::Checked;
use crate::proto::serve_oracle_request::Message as Say;
use crate::proto::serve_oracle_response::Message as Heard;
use crate::proto::{Busy, Hello, OracleFailure, QueryChunk, ServeOracleRequest, Welcome};
use crate::retry::{Flag, Outage};

const ANSWER_BYTES: usize = 3_000_000; // an answer has to stay below the server's 4 MB
const MESSAGE_BYTES: usize = 4000;
const BUSY_SHARE: f64 = 0.25; // of the time that the server bears silence

/// How a worker serves.
#[derive(Clone, Debug, Default)]
pub struct WorkerOptions {
    /// Its name, for logs.
    pub worker: String,
    /// Most points in one call of the oracle; by default the server decides.
    pub max_chunk: Option<usize>,
}

/// Why a stream ended before the mesh.
enum Broken {
    Stream(Status),
    Ours(Error),
}

type Outbox = mpsc::UnboundedSender<ServeOracleRequest>;

pub struct Worker<'a> {
    client: &'a Client,
    oracle: &'a Checked<'a>,
    hello: Hello,
    outage: Outage<'a>,
    /// Whether the server hears of a failure of the oracle's, which ends the mesh.
    pub tells: bool,
}

impl<'a> Worker<'a> {
    pub fn new(
        client: &'a Client,
        oracle: &'a Checked<'a>,
        mesh: &str,
        options: &WorkerOptions,
        quiet: bool,
        stopped: Flag,
    ) -> Self {
        let numbers = oracle.d * (oracle.k + 1 + oracle.k.min(oracle.walls)) + oracle.walls;
        let most = (ANSWER_BYTES / (8 * numbers + 9)).max(1);
        let hello = Hello {
            mesh: mesh.to_string(),
            worker: options.worker.clone(),
            max_chunk_queries: options.max_chunk.map_or(most, |limit| limit.clamp(1, most)) as u32,
            ..Default::default()
        };
        let outage = Outage::new(&client.patience, quiet, stopped);
        Worker { client, oracle, hello, outage, tells: true }
    }

    /// Serves until the mesh is over; a lost stream is opened again. The oracle is called on this thread.
    pub async fn run(mut self) -> Result<String, Error> {
        loop {
            let status = match self.serve().await {
                Ok(state) => return Ok(state),
                Err(Broken::Ours(error)) => return Err(error),
                Err(Broken::Stream(status)) => status,
            };
            if Error::from_status(&status).kind == Kind::FailedPrecondition {
                // It ended before this worker came, or while it was away.
                if let Some(state) = self.how_it_ended().await {
                    return Ok(state);
                }
            }
            self.outage.wait(&status).await?;
        }
    }

    async fn how_it_ended(&self) -> Option<String> {
        for _ in 0..300 {
            let mesh = self.client.get_async(&self.hello.mesh).await.ok()?;
            if mesh.end_time.is_some() {
                return Some(state_name(mesh.state().as_str_name()));
            }
            tokio::time::sleep(Duration::from_millis(100)).await; // it is just about to end
        }
        None
    }

    async fn serve(&mut self) -> Result<String, Broken> {
        let (outbox, requests) = mpsc::unbounded_channel();
        let mut outbox = Some(outbox);
        say(outbox.as_ref(), Say::Hello(self.hello.clone()));
        let mut stub = self.client.stub.clone();
        let opened = tokio::select! {
            opened = stub.serve_oracle(UnboundedReceiverStream::new(requests)) => opened,
            () = self.outage.stopped.wait() => return Ok(String::new()),
        };
        let mut stream = opened.map_err(Broken::Stream)?.into_inner();
        let busy = Arc::new(AtomicU64::new(0)); // the lease that the oracle is at, or 0
        let mut teller = None;
        let mut state = String::new();
        let mut failed = None;
        loop {
            let response = tokio::select! {
                response = stream.message() => response,
                () = self.outage.stopped.wait() => {
                    return failed.map_or(Ok(String::new()), |error| Err(Broken::Ours(error)));
                }
            };
            let message = match (response, failed.take()) {
                (Ok(Some(_)), Some(error)) => {
                    failed = Some(error); // until the server has taken note
                    continue;
                }
                (_, Some(error)) => return Err(Broken::Ours(error)), // ABORTED, as announced
                (Err(status), None) => return Err(Broken::Stream(status)),
                (Ok(None), None) => return Ok(state),
                (Ok(Some(response)), None) => response.message,
            };
            self.outage.heard();
            match message {
                Some(Heard::Queries(chunk)) => {
                    busy.store(chunk.lease, Ordering::Relaxed);
                    failed = self.reply(&mut outbox, &chunk).err();
                    busy.store(0, Ordering::Relaxed);
                }
                Some(Heard::Welcome(welcome)) => {
                    self.compare(&welcome).map_err(Broken::Ours)?;
                    if welcome.answer_seconds > 0.0 {
                        let every = Duration::from_secs_f64(BUSY_SHARE * welcome.answer_seconds);
                        let told = tell_busy(outbox.as_ref().map(Outbox::downgrade), busy.clone(), every);
                        teller.get_or_insert_with(|| AbortOnDrop(tokio::spawn(told)));
                    }
                }
                Some(Heard::Over(over)) => {
                    state = state_name(&over.state);
                    outbox = None; // ends our half
                }
                None => {} // of a newer server
            }
        }
    }

    /// Has the oracle answer, and sends that, or the failure, which it returns.
    fn reply(&self, outbox: &mut Option<Outbox>, chunk: &QueryChunk) -> Result<(), Error> {
        let error = match self.oracle.answer(chunk) {
            Ok(answers) => {
                say(outbox.as_ref(), Say::Answers(answers));
                return Ok(());
            }
            Err(error) => error,
        };
        let mut message = error.to_string();
        let cut = (0..=MESSAGE_BYTES.min(message.len())).rev().find(|&at| message.is_char_boundary(at));
        message.truncate(cut.unwrap_or(0));
        if self.tells {
            say(
                outbox.as_ref(),
                Say::Failure(OracleFailure { lease: chunk.lease, message, ..Default::default() }),
            );
        }
        *outbox = None; // without a word as a worker that has to go
        Err(error)
    }

    /// Leaves the mesh alone if this oracle is not of its kind.
    fn compare(&self, welcome: &Welcome) -> Result<(), Error> {
        let (k, d) = (welcome.dimension as usize, welcome.ambient_dimension as usize);
        let (asked, able) = (welcome.oracle.clone().unwrap_or_default(), self.oracle.capabilities());
        let lacks = [
            (asked.intersect_flat && !able.intersect_flat, "intersect_flat"),
            (asked.tangent_basis && !able.tangent_basis, "tangent_basis"),
            (asked.local_size && !able.local_size, "local_size"),
        ];
        let missing: Vec<&str> = lacks.iter().filter(|(lack, _)| *lack).map(|(_, name)| *name).collect();
        let problem = if (k, d) != (self.oracle.k, self.oracle.d) {
            format!(
                "the mesh has dimension {k} in R^{d}, and this oracle's manifold has dimension {} in R^{}",
                self.oracle.k, self.oracle.d
            )
        } else if welcome.walls as usize != self.oracle.walls {
            format!("the mesh has {} walls, and this manifold {}", welcome.walls, self.oracle.walls)
        } else if missing.is_empty() {
            return Ok(());
        } else {
            format!("the mesh was declared with {}, which this oracle lacks", missing.join(" and "))
        };
        Err(Error::invalid(format!("{problem}: all workers of a mesh have to serve one manifold")))
    }
}

fn state_name(state: &str) -> String {
    state.trim_start_matches("MESH_STATE_").to_string()
}

/// Whether it can still be sent shows when the stream is read.
fn say(outbox: Option<&Outbox>, message: Say) {
    if let Some(outbox) = outbox {
        let _ = outbox.send(ServeOracleRequest { message: Some(message) });
    }
}

/// Says now and then that the oracle is at a chunk, so that the server does not take a slow worker for a
/// dead one.
async fn tell_busy(
    outbox: Option<mpsc::WeakUnboundedSender<ServeOracleRequest>>,
    busy: Arc<AtomicU64>,
    every: Duration,
) {
    loop {
        tokio::time::sleep(every).await;
        let lease = busy.load(Ordering::Relaxed);
        let Some(outbox) = outbox.as_ref().and_then(|weak| weak.upgrade()) else { return };
        if lease != 0 {
            say(Some(&outbox), Say::Busy(Busy { lease, ..Default::default() }));
        }
    }
}

struct AbortOnDrop(tokio::task::JoinHandle<()>);

impl Drop for AbortOnDrop {
    fn drop(&mut self) {
        self.0.abort();
    }
}
