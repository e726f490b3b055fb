//! How and where a mesh is made.

use std::path::PathBuf;

use crate::client::{Client, ClientOptions};
use crate::proto::Progress;
use crate::retry::Flag;
use crate::spec::MeshOptions;

/// Where the server is.
pub enum Connection<'a> {
    /// One is started, and stopped afterwards.
    Own,
    /// A connection that there is.
    Client(&'a Client),
    /// "host:port" or "unix:/path", and how to reach it.
    Server(&'a str, ClientOptions),
}

/// Called with how a mesh stands.
pub type OnProgress<'a> = Box<dyn FnMut(&Progress) + 'a>;

/// Cancels meshes, from any thread: `RunOptions::cancel`.
#[derive(Clone, Debug, Default)]
pub struct Cancel(pub(crate) Flag);

impl Cancel {
    /// The mesh ends with an error of kind `Cancelled`, which has the mesh so far.
    pub fn cancel(&self) {
        self.0.set();
    }
}

/// How a mesh is made.
pub struct RunOptions<'a> {
    /// Where.
    pub connection: Connection<'a>,
    /// What is asked of it.
    pub mesh: MeshOptions,
    /// Streams that call the oracle in parallel, each on a thread of its own.
    pub workers: usize,
    /// Most points in one call of the oracle; by default the server decides.
    pub max_chunk: Option<usize>,
    /// A mesh that is not proved good is an error of kind `NotCertified`.
    pub require_certified: bool,
    /// A directory, made if it is not there, in which the mesh outlives this program: the same call goes
    /// on from where the last one was cancelled or killed, or its oracle failed, and gives a mesh that is
    /// finished immediately. For `Connection::Own`; other servers keep their meshes with --data-dir.
    pub checkpoint: Option<PathBuf>,
    /// Called on this thread.
    pub on_progress: Option<OnProgress<'a>>,
    /// From elsewhere, the end.
    pub cancel: Cancel,
}

impl Default for RunOptions<'_> {
    /// One worker on a server of one's own.
    fn default() -> Self {
        RunOptions {
            connection: Connection::Own,
            mesh: MeshOptions::default(),
            workers: 1,
            max_chunk: None,
            require_certified: false,
            checkpoint: None,
            on_progress: None,
            cancel: Cancel::default(),
        }
    }
}

/// Whether more of a growing mesh is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Growth {
    /// Yes.
    GoOn,
    /// No: the mesh is cancelled, or that of others left alone.
    Leave,
}
