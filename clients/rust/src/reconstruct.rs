//! Points in, a mesh out.

use std::sync::atomic::Ordering;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use ring::digest::{digest, SHA256};
use tokio::time::timeout;
use tonic::Status;

use crate::client::Client;
use crate::error::{Error, Kind};
use crate::mesh::Mesh;
use crate::options::{Cancel, Connection, OnProgress};
use crate::proto::points_chunk::Message;
use crate::proto::watch_mesh_response::Event;
use crate::proto::{
    Mesh as MeshInfo, Points, PointsChunk, PointsEnd, ReconstructReply, Reconstruction, WatchMeshRequest,
};
use crate::retry::{Flag, Outage};
use crate::session::{download, insist_on_certified, with_client};
use crate::shared::reconnect;
use crate::wire::to_wire;

const CHUNK_BYTES: u64 = 1 << 20; // of the points in a message, where the server takes as much

/// Points on a k-manifold in R^d, or near it.
#[derive(Clone, Copy, Debug, Default)]
pub struct PointCloud<'a> {
    /// k of the manifold, 1 to 3.
    pub dimension: usize,
    /// d, more than k.
    pub ambient_dimension: usize,
    /// `[n, d]`, one point after the other, finite.
    pub points: &'a [f64],
    /// `[n, d, k]`, of each point orthonormal tangent vectors, its columns; None: they are estimated.
    pub tangents: Option<&'a [f64]>,
}

/// How points become a mesh.
pub struct ReconstructOptions<'a> {
    /// Where.
    pub connection: Connection<'a>,
    /// What is asked of it: noise, declared_reach, drop, open, label... mesh.proto says what each means.
    pub spec: Reconstruction,
    /// A mesh that is not proved good is an error of kind `NotCertified`.
    pub require_certified: bool,
    /// Called on this thread.
    pub on_progress: Option<OnProgress<'a>>,
    /// From elsewhere, the end: an error of kind `Cancelled`.
    pub cancel: Cancel,
}

impl Default for ReconstructOptions<'_> {
    /// On a server of one's own.
    fn default() -> Self {
        ReconstructOptions {
            connection: Connection::Own,
            spec: Reconstruction::default(),
            require_certified: false,
            on_progress: None,
            cancel: Cancel::default(),
        }
    }
}

/// Makes a mesh of points on a manifold, or near it. Point i is vertex i of the mesh, and `Mesh::places`
/// says what became of it. An upload that breaks off goes on from what the server has.
pub fn reconstruct(cloud: PointCloud, options: ReconstructOptions) -> Result<Mesh, Error> {
    cloud.check()?;
    let ReconstructOptions { connection, spec, require_certified, on_progress, cancel } = options;
    let mesh = with_client(connection, |client| {
        let name = client.runtime.block_on(declare(client, cloud.spec(spec)))?;
        let sending = send_and_watch(client, &name, &cloud, on_progress, &cancel);
        let made =
            client.runtime.block_on(sending).and_then(|()| download(&name, 0, Connection::Client(client)));
        let _ = client.runtime.block_on(client.delete_async(&name, true)); // it ends with its server
        made
    })?;
    if require_certified {
        return insist_on_certified(mesh);
    }
    Ok(mesh)
}

impl PointCloud<'_> {
    fn check(&self) -> Result<(), Error> {
        let (k, d) = (self.dimension, self.ambient_dimension);
        if k < 1 || d < 1 || u32::try_from(k.max(d)).is_err() {
            return Err(Error::invalid(format!("dimensions have to be from 1 on, and are {k} and {d}")));
        }
        if !self.points.len().is_multiple_of(d) {
            return Err(Error::invalid(format!(
                "{} numbers are no whole points of R^{d}",
                self.points.len()
            )));
        }
        if let Some(at) = self.points.iter().position(|x| !x.is_finite()) {
            return Err(Error::invalid(format!("point {} is not finite", at / d)));
        }
        match self.tangents {
            Some(tangents) if tangents.len() != k * self.points.len() => Err(Error::invalid(format!(
                "tangents have {} numbers, and need {}: [n, d, k]",
                tangents.len(),
                k * self.points.len()
            ))),
            _ => Ok(()),
        }
    }

    fn count(&self) -> usize {
        self.points.len() / self.ambient_dimension
    }

    fn spec(&self, more: Reconstruction) -> Reconstruction {
        Reconstruction {
            dimension: self.dimension as u32,
            ambient_dimension: self.ambient_dimension as u32,
            points: self.count() as u64,
            tangents: self.tangents.is_some(),
            ..more
        }
    }

    /// Which rows a chunk ends before. `most_bytes`: that the server takes in a message.
    fn chunk_end(&self, row: usize, most_bytes: u64) -> usize {
        let vectors = self.tangents.map_or(1, |_| 1 + self.dimension);
        let rows = CHUNK_BYTES.min(most_bytes / 2) as usize / (8 * self.ambient_dimension * vectors);
        self.count().min(row + rows.max(1))
    }

    fn chunk(&self, row: usize, end: usize) -> PointsChunk {
        let (k, d) = (self.dimension, self.ambient_dimension);
        message(Message::Points(Points {
            first_row: row as u64,
            points: Some(to_wire(&self.points[row * d..end * d], &[end - row, d])),
            tangents: self.tangents.map(|all| to_wire(&all[row * d * k..end * d * k], &[end - row, d, k])),
        }))
    }

    fn end(&self) -> PointsChunk {
        let of = |values: &[f64]| {
            let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
            digest(&SHA256, &bytes).as_ref().to_vec()
        };
        message(Message::End(PointsEnd {
            points_sha256: of(self.points),
            tangents_sha256: self.tangents.map(of).unwrap_or_default(),
        }))
    }
}

fn message(message: Message) -> PointsChunk {
    PointsChunk { message: Some(message) }
}

/// Once: whether the mesh was made would not be known.
async fn declare(client: &Client, spec: Reconstruction) -> Result<String, Error> {
    let mut stub = client.stub.clone();
    let request = tokio_stream::once(message(Message::Spec(spec)));
    let limited = timeout(Duration::from_secs_f64(reconnect::CALL), stub.reconstruct(request)).await;
    let late = |_| Status::unavailable("the server did not answer in time");
    let reply =
        limited.map_err(late).and_then(|reply| reply).map_err(|status| Error::from_status(&status))?;
    client.patience.reached.store(true, Ordering::Relaxed);
    Ok(reply.into_inner().mesh.unwrap_or_default().name)
}

/// Returns once all points are there and the mesh is over.
async fn send_and_watch(
    client: &Client,
    name: &str,
    cloud: &PointCloud<'_>,
    on_progress: Option<OnProgress<'_>>,
    cancel: &Cancel,
) -> Result<(), Error> {
    let refused = Mutex::new(None);
    let upload = async {
        match upload(client, name, cloud).await {
            // It is over, and the watch says how it ended.
            Err(error) if error.kind != Kind::FailedPrecondition => {
                *refused.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            }
            _ => std::future::pending().await,
        }
    };
    let over = tokio::select! {
        over = watch(client, name, on_progress) => over,
        () = upload => Ok(()),
        () = cancel.0.wait() => {
            Err(Error::new(Kind::Cancelled, "CANCELLED", "the reconstruction is cancelled"))
        }
    };
    match refused.into_inner().unwrap_or_else(PoisonError::into_inner) {
        // How the mesh ended says more than why its upload was refused then.
        Some(error) if client.get_async(name).await?.end_time.is_none() => Err(error),
        _ => over,
    }
}

async fn watch(client: &Client, name: &str, mut on_progress: Option<OnProgress<'_>>) -> Result<(), Error> {
    let request = WatchMeshRequest { name: name.to_string(), progress_only: true, ..Default::default() };
    let open = |mut stub: crate::client::Stub| {
        let request = request.clone();
        async move { stub.watch_mesh(request).await }
    };
    client
        .follow_stream(Flag::default(), open, |message| match message.and_then(|message| message.event) {
            Some(Event::Progress(now)) => {
                if let Some(tell) = on_progress.as_mut() {
                    tell(&now);
                }
                Ok(false)
            }
            Some(Event::Final(MeshInfo { .. })) => Ok(true),
            _ => Ok(false),
        })
        .await
}

/// After a break it goes on from what the server has recorded.
async fn upload(client: &Client, name: &str, cloud: &PointCloud<'_>) -> Result<(), Error> {
    let most = client.info_async().await?.max_message_bytes;
    let mut outage = Outage::new(&client.patience, true, Flag::default()); // the watch tells
    loop {
        match send_all(client, name, cloud, most).await {
            Ok(_) => {
                outage.heard();
                return Ok(());
            }
            Err(status) => outage.wait(&status).await?,
        }
    }
}

async fn send_all(
    client: &Client,
    name: &str,
    cloud: &PointCloud<'_>,
    most: u64,
) -> Result<ReconstructReply, Status> {
    let first = message(Message::Mesh(name.to_string()));
    let mut stub = client.stub.clone();
    let rows = stub.reconstruct(tokio_stream::once(first.clone())).await?.into_inner().rows;
    let (sender, receiver) = tokio::sync::mpsc::channel(2);
    let feed = async move {
        let mut row = rows as usize;
        // What cannot be sent is of a call that has ended: its reply says how.
        if sender.send(first).await.is_err() {
            return;
        }
        while row < cloud.count() {
            let end = cloud.chunk_end(row, most);
            if sender.send(cloud.chunk(row, end)).await.is_err() {
                return;
            }
            row = end;
        }
        let _ = sender.send(cloud.end()).await;
    };
    let call = stub.reconstruct(tokio_stream::wrappers::ReceiverStream::new(receiver));
    let (reply, ()) = tokio::join!(call, feed);
    Ok(reply?.into_inner())
}
