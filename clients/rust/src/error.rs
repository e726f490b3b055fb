//! What can go wrong.

use std::collections::BTreeMap;
use std::fmt;

use prost::Message;
use tonic::{Code, Status};

use crate::oracle::BoxError;
use crate::Mesh;

mod rpc {
    #![allow(missing_docs, dead_code)]
    tonic::include_proto!("stellate.rpc");
}

const DOMAIN: &str = "stellate.v1"; // others stand between us and the server
/// Reasons whose kind is none in particular; that of others which are unknown goes by their code.
const OURS: [&str; 4] = ["INTERNAL", "JOURNAL_FULL", "JOURNAL_FAILED", "REPLAY_MISMATCH"];

/// What kind of thing went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kind {
    /// A specification that makes no sense. Mend the field that the message names.
    InvalidArgument,
    /// More than the server is willing to do. Ask for less, or raise its limit.
    LimitExceeded,
    /// No mesh has this name: it is misspelt, or the mesh was deleted.
    MeshNotFound,
    /// A call out of order, such as serving a mesh that is over.
    FailedPrecondition,
    /// The server wants a token, and got none that it knows.
    Unauthenticated,
    /// The oracle's answers break a rule, or the mesh got none. Mend the oracle.
    Oracle,
    /// The oracle itself failed; the source is its error.
    Raised,
    /// The mesh was cancelled, by a `Cancel` or by somebody else.
    Cancelled,
    /// The server cannot be reached, or is stopping.
    Unavailable,
    /// No server was given, and there is no stellated on this machine to start.
    ServerNotFound,
    /// A mesh that the chosen file format cannot hold, or a file that cannot be written.
    Save,
    /// The mesh is finished and not proved good, which `require_certified` insists on.
    NotCertified,
    /// Every other error of the server, its own faults among them.
    Other,
}

/// Every error of this crate.
#[derive(Debug)]
#[non_exhaustive]
pub struct Error {
    /// What kind of thing went wrong.
    pub kind: Kind,
    /// Its stable name, e.g. "ORACLE_NOT_FINITE"; see errors.proto.
    pub reason: Box<str>,
    /// For people.
    pub message: String,
    /// What is wrong with which field of a request.
    pub fields: BTreeMap<String, String>,
    /// What else is known, e.g. the "limit" that is exceeded.
    pub details: BTreeMap<String, String>,
    /// The unfinished mesh as far as it came, where there is one.
    pub mesh: Option<Box<Mesh>>,
    source: Option<BoxError>,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.source.as_deref().map(|error| error as _)
    }
}

impl Error {
    pub(crate) fn new(kind: Kind, reason: &str, message: impl Into<String>) -> Self {
        Error {
            kind,
            reason: reason.into(),
            message: message.into(),
            fields: BTreeMap::new(),
            details: BTreeMap::new(),
            mesh: None,
            source: None,
        }
    }

    pub(crate) fn invalid(message: impl Into<String>) -> Self {
        Error::new(Kind::InvalidArgument, "INVALID_ARGUMENT", message)
    }

    pub(crate) fn protocol(what: impl fmt::Display) -> Self {
        Error::new(Kind::Other, "PROTOCOL", format!("the server broke the protocol: {what}"))
    }

    pub(crate) fn raised(source: BoxError) -> Self {
        let mut error = Error::new(Kind::Raised, "ORACLE_FAILED", source.to_string());
        error.source = Some(source);
        error
    }

    /// The error for a failed call, with the reason and the fields that the server named.
    pub fn from_status(status: &Status) -> Self {
        let mut error = Error::new(Kind::Other, "", status.message());
        let details = rpc::Status::decode(status.details()).unwrap_or_default().details;
        for part in details {
            match part.type_url.rsplit('/').next() {
                Some("google.rpc.ErrorInfo") => {
                    let info = rpc::ErrorInfo::decode(&part.value[..]).unwrap_or_default();
                    if info.domain != DOMAIN {
                        continue;
                    }
                    error.kind = Kind::of_reason(&info.reason);
                    error.reason = info.reason.into();
                    error.details = info.metadata.into_iter().collect();
                }
                Some("google.rpc.BadRequest") => {
                    let request = rpc::BadRequest::decode(&part.value[..]).unwrap_or_default();
                    let violations = request.field_violations.into_iter();
                    error.fields = violations.map(|v| (v.field, v.description)).collect();
                }
                _ => {}
            }
        }
        if error.kind == Kind::Other && !OURS.contains(&&*error.reason) {
            error.kind = Kind::of_code(status.code());
        }
        if error.reason.is_empty() {
            error.reason = format!("{:?}", status.code()).to_uppercase().into();
        }
        if error.kind == Kind::Unauthenticated {
            error.message += "; give a token with the Credentials of ClientOptions";
        }
        if let Some(cause) = root_cause(status).filter(|cause| !error.message.contains(cause.as_str())) {
            error.message = format!("{}: {cause}", error.message);
        }
        error
    }
}

/// The deepest reason that the transport gives.
fn root_cause(status: &Status) -> Option<String> {
    let mut cause = std::error::Error::source(status)?;
    while let Some(deeper) = cause.source() {
        cause = deeper;
    }
    Some(cause.to_string())
}

impl Kind {
    /// The kind for one of the protocol's reasons.
    pub fn of_reason(reason: &str) -> Self {
        match reason {
            "INVALID_ARGUMENT" | "REVISION_TOO_NEW" => Kind::InvalidArgument,
            "OUT_OF_ORDER" | "FAILED_PRECONDITION" => Kind::FailedPrecondition,
            "LIMIT_EXCEEDED" => Kind::LimitExceeded,
            "MESH_NOT_FOUND" => Kind::MeshNotFound,
            "SHUTTING_DOWN" => Kind::Unavailable,
            "UNAUTHENTICATED" => Kind::Unauthenticated,
            "NO_SEEDS" | "NO_WORKER" | "ANSWER_TIMEOUT" | "WORKERS_DISAGREE" => Kind::Oracle,
            _ if reason.starts_with("ORACLE_") => Kind::Oracle,
            _ => Kind::Other,
        }
    }

    fn of_code(code: Code) -> Self {
        match code {
            Code::InvalidArgument | Code::OutOfRange => Kind::InvalidArgument,
            Code::ResourceExhausted => Kind::LimitExceeded,
            Code::NotFound => Kind::MeshNotFound,
            Code::FailedPrecondition => Kind::FailedPrecondition,
            Code::Unauthenticated | Code::PermissionDenied => Kind::Unauthenticated,
            Code::Aborted => Kind::Oracle,
            Code::Cancelled => Kind::Cancelled,
            Code::Unavailable | Code::DeadlineExceeded => Kind::Unavailable,
            _ => Kind::Other,
        }
    }
}
