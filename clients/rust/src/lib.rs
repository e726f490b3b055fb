//! Meshes compact smooth manifolds of any dimension, with or without boundary, known through oracles
//! alone.
//!
//! Arrays are flat, in C order: point i of a batch in R^d is `x[i * d..(i + 1) * d]`, and entry (row,
//! column) of its basis `[d, k]` is `bases[(i * d + row) * k + column]`.

#![warn(missing_docs)]
// The protocol's messages may get more fields.
#![allow(clippy::needless_update)]

mod check;
mod checkpoint;
mod client;
mod credentials;
mod error;
mod growth;
pub mod manifolds;
mod mesh;
mod options;
mod oracle;
mod progress;
mod reconstruct;
mod retry;
mod rows;
mod server;
mod session;
mod spec;
mod wire;
mod worker;

/// The tables of clients/shared.
#[allow(dead_code)] // the pauses of gRPC's own are not to be set here
mod shared {
    include!(concat!(env!("OUT_DIR"), "/shared.rs"));
}

/// The protocol's own messages.
#[allow(missing_docs, clippy::doc_lazy_continuation, clippy::doc_overindented_list_items)]
pub mod proto {
    tonic::include_proto!("stellate.v1");
}

pub use check::{check, choose_epsilon};
pub use client::{Client, ClientOptions};
pub use credentials::Credentials;
pub use error::{Error, Kind};
pub use growth::GrowingComplex;
pub use mesh::{check_save, Mesh};
pub use options::{Cancel, Connection, Growth, OnProgress, RunOptions};
pub use oracle::{BoxError, Capabilities, Oracle};
pub use progress::progress_bar;
pub use reconstruct::{reconstruct, PointCloud, ReconstructOptions};
pub use server::{find_stellated, Server, ServerOptions};
pub use session::{download, mesh, serve, watch, watch_by_name};
pub use spec::MeshOptions;
pub use worker::WorkerOptions;
