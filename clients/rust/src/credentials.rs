//! How a client shows a server who it is, and makes sure of the server.

use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;

use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::transport::{Certificate, ClientTlsConfig, Identity};
use tonic::{Request, Status};

use crate::error::Error;

/// TLS, and a token, for a server that wants them. Files are PEM.
#[derive(Clone, Default)]
pub struct Credentials {
    /// Sent with every call. Over plain text only within this machine.
    pub token: Option<String>,
    /// File with the authority that signed the server's certificate.
    pub ca: Option<PathBuf>,
    /// Files with the client's own certificate and key, for a server that asks for one.
    pub identity: Option<(PathBuf, PathBuf)>,
    /// TLS with the system's authorities; implied by `ca` and `identity`.
    pub tls: bool,
}

impl Credentials {
    /// None for plain text.
    pub(crate) fn tls_config(&self, address: &str) -> Result<Option<ClientTlsConfig>, Error> {
        if !(self.tls || self.ca.is_some() || self.identity.is_some()) {
            if self.token.is_some() && !stays_on_this_machine(address) {
                return Err(Error::invalid(format!(
                    "the token would go to {address} in plain text, for others to read and use: turn TLS on"
                )));
            }
            return Ok(None);
        }
        let read = |path: &PathBuf| {
            std::fs::read(path).map_err(|error| Error::invalid(format!("{}: {error}", path.display())))
        };
        let mut config = match &self.ca {
            Some(ca) => ClientTlsConfig::new().ca_certificate(Certificate::from_pem(read(ca)?)),
            None => ClientTlsConfig::new().with_native_roots(),
        };
        if let Some((certificate, key)) = &self.identity {
            config = config.identity(Identity::from_pem(read(certificate)?, read(key)?));
        }
        Ok(Some(config))
    }
}

/// Whether a server's address is a unix socket or the loopback.
pub(crate) fn stays_on_this_machine(address: &str) -> bool {
    address.starts_with("unix:")
        || address.starts_with("localhost:")
        || address.parse::<SocketAddr>().is_ok_and(|at| match at.ip() {
            IpAddr::V4(ip) => ip.is_loopback(),
            IpAddr::V6(ip) => ip.is_loopback(),
        })
}

/// Sends the token with every call.
#[derive(Clone)]
pub struct Token(Option<MetadataValue<Ascii>>);

impl Token {
    pub(crate) fn new(token: Option<&str>) -> Result<Self, Error> {
        let header = token.map(|token| format!("Bearer {token}").parse()).transpose();
        header.map(Token).map_err(|_| Error::invalid("the token has characters that no header may have"))
    }
}

impl Interceptor for Token {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(header) = &self.0 {
            request.metadata_mut().insert("authorization", header.clone());
        }
        Ok(request)
    }
}
