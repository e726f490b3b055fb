//! A mesh from its declaration to its end: the server asks, the oracle answers, we watch.

use std::panic::{catch_unwind, resume_unwind, AssertUnwindSafe};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use crate::checkpoint::Checkpoint;
use crate::client::{Client, ClientOptions};
use crate::error::{Error, Kind};
use crate::growth::GrowingComplex;
use crate::mesh::Mesh;
use crate::options::{Connection, Growth, OnProgress, RunOptions};
use crate::oracle::{Checked, Oracle};
use crate::proto::watch_mesh_response::Event;
use crate::proto::{
    DownloadMeshRequest, Mesh as MeshInfo, MeshDelta, MeshState, Phase, Progress, WatchMeshRequest,
};
use crate::retry::Flag;
use crate::server::{Server, ServerOptions};
use crate::worker::{Worker, WorkerOptions};

const FAREWELL: Duration = Duration::from_secs(2); // that a worker may take to end by itself

pub(crate) fn with_client<T>(
    connection: Connection,
    use_it: impl FnOnce(&Client) -> Result<T, Error>,
) -> Result<T, Error> {
    match connection {
        Connection::Client(client) => use_it(client),
        Connection::Server(address, options) => use_it(&Client::new(address, options)?),
        Connection::Own => {
            let server = Server::start(&ServerOptions::default())?;
            let client = Client::of(&server, ClientOptions::default())?;
            use_it(&client)
        }
    }
}

/// Meshes the oracle's manifold. `epsilon` is the largest circumradius of a simplex, a length.
pub fn mesh(oracle: &dyn Oracle, epsilon: f64, options: RunOptions) -> Result<Mesh, Error> {
    let certified = options.require_certified;
    let mut last = None;
    run(oracle, epsilon, options, false, &mut |mesh| {
        last = Some(mesh);
        Growth::GoOn
    })?;
    let finished = last.ok_or_else(|| Error::protocol("it ended the watch too early"))?;
    if certified {
        return insist_on_certified(finished);
    }
    Ok(finished)
}

pub(crate) fn insist_on_certified(finished: Mesh) -> Result<Mesh, Error> {
    if finished.certified() {
        return Ok(finished);
    }
    let verdict = finished.report.as_ref().and_then(|report| report.certificate.as_ref());
    let verdict = verdict.map_or(String::new(), |certificate| certificate.verdict.clone());
    let message = format!("the mesh is not certified: {verdict}");
    let mut error = Error::new(Kind::NotCertified, "NOT_CERTIFIED", message);
    error.mesh = Some(Box::new(finished));
    Err(error)
}

/// The mesh as it grows, at every revision; the last one has its report.
pub fn watch(
    oracle: &dyn Oracle,
    epsilon: f64,
    options: RunOptions,
    mut each: impl FnMut(Mesh) -> Growth,
) -> Result<(), Error> {
    run(oracle, epsilon, options, true, &mut each)
}

/// A mesh that others serve, as it grows.
pub fn watch_by_name(
    name: &str,
    connection: Connection,
    mut each: impl FnMut(Mesh) -> Growth,
) -> Result<(), Error> {
    with_client(connection, |client| {
        let info = client.get(name)?;
        let nobody = Flag::default();
        client.runtime.block_on(follow(client, &info, nobody, None, true, &mut each))
    })
}

/// One more worker for a mesh: see `Client::serve`.
pub fn serve(
    oracle: &dyn Oracle,
    name: &str,
    connection: Connection,
    options: &WorkerOptions,
) -> Result<String, Error> {
    with_client(connection, |client| client.serve(oracle, name, options))
}

/// Fetches a mesh that is on a server: one that is over, or, with a revision, as it was then.
pub fn download(name: &str, revision: u64, connection: Connection) -> Result<Mesh, Error> {
    with_client(connection, |client| {
        let info = client.get(name)?;
        if info.end_time.is_none() && revision == 0 {
            let message = format!("{name} is not over: {}", info.state().as_str_name());
            return Err(Error::new(Kind::FailedPrecondition, "FAILED_PRECONDITION", message));
        }
        let mesh = client.runtime.block_on(assemble(client, &info, revision))?;
        if revision > 0 {
            return Ok(mesh);
        }
        judge(Mesh { progress: info.progress, report: info.report.clone(), ..mesh }, &info)
    })
}

fn empty(info: &MeshInfo) -> GrowingComplex {
    // The boundary alone has simplices of one dimension less.
    let (k, d) = info.spec.as_ref().map_or((1, 2), |spec| {
        (spec.dimension.saturating_sub(u32::from(spec.boundary_only)), spec.ambient_dimension)
    });
    GrowingComplex::new(k as usize, d as usize)
}

async fn assemble(client: &Client, info: &MeshInfo, revision: u64) -> Result<Mesh, Error> {
    let mut growth = empty(info);
    let d = info.spec.as_ref().map_or(0, |spec| i64::from(spec.ambient_dimension));
    let request =
        Mutex::new(DownloadMeshRequest { name: info.name.clone(), revision, ..Default::default() });
    let lock = || request.lock().unwrap_or_else(PoisonError::into_inner);
    let open = |mut stub: crate::client::Stub| {
        let request = lock().clone();
        async move { stub.download_mesh(request).await }
    };
    client
        .follow_stream(Flag::default(), open, |part| {
            let Some(part) = part else { return Ok(false) };
            let mut next = lock();
            (next.revision, next.position) = (part.revision, part.next_position);
            growth.set_revision(part.revision);
            let points = crate::wire::numbers(part.points.as_ref(), &[-1, d]);
            growth.add_points(part.first_vertex, &points.map_err(Error::protocol)?)?;
            let extents = part.cells.as_ref().and_then(|cells| cells.shape.first());
            let cells = extents.map_or(0, |&rows| rows as usize);
            growth.change(&MeshDelta {
                added: part.cells,
                boundary_vertices: part.boundary_vertices,
                boundary_walls: part.boundary_walls,
                ..Default::default()
            })?;
            growth.orient_part(cells, part.orientation)?;
            growth.add_places(part.places)?;
            Ok(part.complete)
        })
        .await?;
    growth.downloaded()
}

/// Hands on a mesh at every revision and at its end. An error is how it failed.
async fn follow(
    client: &Client,
    info: &MeshInfo,
    stopped: Flag,
    mut on_progress: Option<OnProgress<'_>>,
    every: bool,
    each: &mut dyn FnMut(Mesh) -> Growth,
) -> Result<(), Error> {
    let mut growth = empty(info);
    let mut progress = None;
    let request = WatchMeshRequest { name: info.name.clone(), ..Default::default() };
    let request = Mutex::new(request);
    let lock = || request.lock().unwrap_or_else(PoisonError::into_inner);
    let open = |mut stub: crate::client::Stub| {
        let request = lock().clone();
        async move { stub.watch_mesh(request).await }
    };
    let mut note = |now: Progress| {
        if let Some(tell) = on_progress.as_mut() {
            tell(&now);
        }
        Some(now)
    };
    let events = client.follow_stream(stopped.clone(), open, |message| {
        let Some(message) = message else {
            growth.forget_pending();
            return Ok(false);
        };
        match message.event {
            Some(Event::Delta(chunk)) => {
                let complete = growth.absorb(chunk)?;
                lock().from_revision = growth.revision();
                if complete && every {
                    return Ok(each(Mesh { progress, ..growth.mesh()? }) == Growth::Leave);
                }
            }
            Some(Event::ResetMesh(_)) => {
                growth.reset();
                lock().from_revision = 0;
            }
            Some(Event::Orientation(chunk)) => growth.orient(chunk)?,
            Some(Event::Progress(now)) => {
                progress = note(now);
                if now.phase() == Phase::Certifying {
                    growth.settle()?; // while the server is busy
                }
            }
            Some(Event::Final(last)) => {
                progress = last.progress.and_then(&mut note);
                let mesh = Mesh { progress, report: last.report.clone(), ..growth.finished()? };
                each(judge(mesh, &last)?);
                return Ok(true);
            }
            None => {} // of a newer server
        }
        Ok(false)
    });
    let failed = tokio::select! {
        failed = events => failed,
        () = stopped.wait() => Err(Error::new(Kind::Cancelled, "CANCELLED", "left")),
    };
    failed.map_err(|mut error| {
        error.mesh = error.mesh.take().or_else(|| growth.mesh().ok().map(Box::new));
        error
    })
}

fn judge(mesh: Mesh, info: &MeshInfo) -> Result<Mesh, Error> {
    let mut error = match info.state() {
        MeshState::Cancelled => Error::new(Kind::Cancelled, "CANCELLED", "the mesh was cancelled"),
        MeshState::Failed => {
            let failure = info.report.clone().and_then(|report| report.failure).unwrap_or_default();
            Error::new(Kind::of_reason(&failure.reason), &failure.reason, failure.message)
        }
        _ => return Ok(mesh),
    };
    error.mesh = Some(Box::new(mesh));
    Err(error)
}

fn run(
    oracle: &dyn Oracle,
    epsilon: f64,
    options: RunOptions,
    every: bool,
    each: &mut dyn FnMut(Mesh) -> Growth,
) -> Result<(), Error> {
    let checked = Checked::new(oracle)?;
    let Some(folder) = options.checkpoint.clone() else {
        let (mut options, connection) = (options, Connection::Own);
        let connection = std::mem::replace(&mut options.connection, connection);
        return with_client(connection, |client| {
            let info = client.create_from(client.spec(&checked, epsilon, &options.mesh))?;
            session(client, &checked, &info, options, every, each)
        });
    };
    if !matches!(options.connection, Connection::Own) {
        let what = "a checkpoint is for a private server: one that is named keeps meshes itself";
        return Err(Error::invalid(what));
    }
    let kept = Checkpoint(&folder);
    let server = kept.server()?;
    let client = Client::of(&server, ClientOptions::default())?;
    let info = kept.declare(&client, client.spec(&checked, epsilon, &options.mesh))?;
    let outcome = session(&client, &checked, &info, options, every, each);
    outcome.inspect_err(|error| kept.forget_after(error))
}

/// Serves and watches a mesh side by side, and deletes it in the end, or leaves it to its checkpoint.
fn session(
    client: &Client,
    checked: &Checked,
    info: &MeshInfo,
    options: RunOptions,
    every: bool,
    each: &mut dyn FnMut(Mesh) -> Growth,
) -> Result<(), Error> {
    let RunOptions { checkpoint, workers, max_chunk, on_progress, cancel, .. } = options;
    let failure = Mutex::new(None);
    let panicked = Mutex::new(None);
    let stopped = Flag::default();
    let (left, ended) = (Flag::default(), Flag::default());
    let outcome = thread::scope(|scope| {
        for i in 0..workers.max(1) {
            let options = WorkerOptions { worker: format!("rust-{}", i + 1), max_chunk };
            let mut worker = Worker::new(client, checked, &info.name, &options, true, stopped.clone());
            worker.tells = checkpoint.is_none();
            let (failure, panicked, left, kept) = (&failure, &panicked, &left, checkpoint.is_some());
            scope.spawn(move || {
                let serve = AssertUnwindSafe(|| client.runtime.block_on(worker.run()));
                let outcome = catch_unwind(serve).unwrap_or_else(|payload| {
                    panicked.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(payload);
                    left.set(); // no other worker would answer
                    Ok(String::new())
                });
                // What the server refuses, or its absence, the watch reports.
                if let Err(error) = outcome {
                    let ours = error.kind == Kind::Raised || &*error.reason == "ORACLE_NOT_FINITE";
                    let mut first = failure.lock().unwrap_or_else(PoisonError::into_inner);
                    if ours && first.is_none() {
                        *first = Some(error);
                    }
                    if ours && kept {
                        left.set(); // the mesh waits for a better oracle
                    }
                }
            });
        }
        let outcome = client.runtime.block_on(async {
            let watching = follow(client, info, left.clone(), on_progress, every, each);
            let cancelling = async {
                tokio::select! {
                    () = cancel.0.wait() => {}
                    () = ended.wait() => return,
                }
                // A server that is away cannot say how the mesh ends; one that is kept does not.
                if checkpoint.is_some() || client.cancel_async(&info.name, true).await.is_err() {
                    left.set();
                }
            };
            let watching = async {
                let outcome = watching.await;
                ended.set();
                outcome
            };
            tokio::join!(watching, cancelling).0
        });
        if outcome.is_ok() {
            // They hear that the mesh is over; one that does not is not waited for.
            let stopped = stopped.clone();
            client.runtime.spawn(async move {
                tokio::time::sleep(FAREWELL).await;
                stopped.set();
            });
        } else {
            left.set();
            stopped.set();
        }
        outcome
    });
    if checkpoint.is_none() {
        let _ = client.runtime.block_on(client.delete_async(&info.name, true)); // it ends with its server
    }
    if let Some(payload) = panicked.into_inner().unwrap_or_else(PoisonError::into_inner) {
        resume_unwind(payload); // the oracle's own, where its owner sees it
    }
    let ours = failure.into_inner().unwrap_or_else(PoisonError::into_inner);
    match (outcome, ours) {
        (Err(theirs), Some(mut ours)) if theirs.kind != Kind::Cancelled || checkpoint.is_some() => {
            ours.mesh = theirs.mesh; // our own says more than the server's account of it
            Err(ours)
        }
        (Err(mut theirs), None) if theirs.kind == Kind::Cancelled && checkpoint.is_some() => {
            let folder = checkpoint.unwrap_or_default();
            theirs.message =
                format!("the mesh is kept in {}: the same call goes on from there", folder.display());
            Err(theirs)
        }
        (outcome, _) => outcome,
    }
}
