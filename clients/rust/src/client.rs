//! The service call by call, for those who need more than `mesh`.

use std::collections::hash_map::RandomState;
use std::future::Future;
use std::hash::{BuildHasher, Hasher};
use std::sync::atomic::AtomicBool;
use std::sync::Arc;
use std::time::Duration;

use tokio::runtime::{Builder, Runtime};
use tonic::service::interceptor::InterceptedService;
use tonic::transport::{Channel, Endpoint};
use tonic::{Response, Status, Streaming};

use crate::credentials::{stays_on_this_machine, Credentials, Token};
use crate::error::{Error, Kind};
use crate::oracle::{Checked, Oracle};
use crate::proto::stellate_client::StellateClient;
use crate::proto::{
    CancelMeshRequest, CreateMeshRequest, DeleteMeshRequest, GetMeshRequest, GetServerInfoRequest,
    ListMeshesRequest, Mesh as MeshInfo, MeshSpec, ServerInfo,
};
use crate::retry::{Flag, Outage, Patience};
use crate::server::Server;
use crate::shared::reconnect;
use crate::spec::MeshOptions;
use crate::worker::{Worker, WorkerOptions};

const LARGEST_MESSAGE: usize = 64 << 20;
const STREAM_WINDOW: u32 = 4 << 20; // so that the next chunk comes while one is answered

pub(crate) type Stub = StellateClient<InterceptedService<Channel, Token>>;

/// How to reach a server.
pub struct ClientOptions {
    /// TLS and a token.
    pub credentials: Credentials,
    /// How long a server that was there and went away is waited for; zero: not at all.
    pub reconnect: Duration,
    /// How long a silent server is trusted before it is pinged; twice as long to answer.
    pub keepalive: Duration,
    /// Called when the server is lost and when it is back.
    pub on_outage: Box<dyn Fn(&str) + Send + Sync>,
}

impl Default for ClientOptions {
    /// No credentials, the waits of clients/shared/reconnect.toml, standard error.
    fn default() -> Self {
        ClientOptions {
            credentials: Credentials::default(),
            reconnect: Duration::from_secs_f64(reconnect::GIVE_UP),
            keepalive: Duration::from_secs_f64(reconnect::KEEPALIVE),
            on_outage: Box::new(|said| eprintln!("stellate: {said}")),
        }
    }
}

/// A connection to a server; any thread may use it, but not from within an async runtime.
pub struct Client {
    address: String,
    pub(crate) stub: Stub,
    pub(crate) runtime: Arc<Runtime>,
    pub(crate) patience: Patience,
}

impl Client {
    /// To "host:port" or "unix:/path".
    pub fn new(server: &str, options: ClientOptions) -> Result<Self, Error> {
        Client::open(server, options, None)
    }

    /// To a server of this process's own.
    pub fn of(server: &Server, options: ClientOptions) -> Result<Self, Error> {
        Client::open(server.address(), options, Some(server))
    }

    fn open(address: &str, options: ClientOptions, own: Option<&Server>) -> Result<Self, Error> {
        let wrong = || Error::invalid(format!("server has to be host:port or unix:/path: {address:?}"));
        let port = address.rsplit_once(':').map(|(_, port)| port.parse::<u16>());
        if !address.starts_with("unix:") && !matches!(port, Some(Ok(_))) {
            return Err(wrong());
        }
        let tls = options.credentials.tls_config(address)?;
        let scheme = match (address.starts_with("unix:"), &tls) {
            (true, _) => "",
            (_, Some(_)) => "https://",
            (_, None) => "http://",
        };
        let name = address.replacen("unix:/", "unix:///", 1);
        let mut endpoint = Endpoint::from_shared(format!("{scheme}{name}")).map_err(|_| wrong())?;
        endpoint = endpoint
            .connect_timeout(Duration::from_secs(5))
            .initial_stream_window_size(STREAM_WINDOW)
            .initial_connection_window_size(2 * STREAM_WINDOW);
        if !own.is_some_and(|server| server.private) {
            // A private server needs no pings: its end shows immediately.
            endpoint = endpoint
                .http2_keep_alive_interval(options.keepalive)
                .keep_alive_timeout(options.keepalive.mul_f64(reconnect::PING_PATIENCE))
                .keep_alive_while_idle(true);
        }
        if let Some(config) = tls {
            let refused = |error| Error::invalid(format!("these credentials do not work: {error}"));
            endpoint = endpoint.tls_config(config).map_err(refused)?;
        }
        let runtime = Builder::new_multi_thread().worker_threads(1).enable_all().build();
        let runtime = runtime.map_err(|error| Error::new(Kind::Other, "INTERNAL", error.to_string()))?;
        let channel = {
            let _inside = runtime.enter();
            endpoint.connect_lazy()
        };
        let token = Token::new(options.credentials.token.as_deref())?;
        let stub = StellateClient::with_interceptor(channel, token)
            .max_decoding_message_size(LARGEST_MESSAGE)
            .max_encoding_message_size(LARGEST_MESSAGE);
        let process = own.map(Server::process);
        let patience = Patience {
            give_up: options.reconnect,
            hopeless: Box::new(move || process.as_ref().and_then(|process| process.why_gone())),
            on_outage: options.on_outage,
            reached: AtomicBool::new(false),
        };
        Ok(Client { address: address.to_string(), stub, runtime: Arc::new(runtime), patience })
    }

    pub(crate) fn outage(&self) -> Outage<'_> {
        Outage::new(&self.patience, false, Flag::default())
    }

    /// Repeats a call while the server is away, unless it is to be made `once`.
    pub(crate) async fn call<T, F>(
        &self,
        outage: &mut Outage<'_>,
        once: bool,
        attempt: impl Fn(Stub) -> F,
    ) -> Result<T, Error>
    where
        F: Future<Output = Result<Response<T>, Status>>,
    {
        loop {
            let limited =
                tokio::time::timeout(Duration::from_secs_f64(reconnect::CALL), attempt(self.stub.clone()))
                    .await;
            let late = |_| Status::unavailable("the server did not answer in time");
            match limited.map_err(late).and_then(|answer| answer) {
                Ok(reply) => {
                    outage.heard();
                    return Ok(reply.into_inner());
                }
                Err(status) if once => {
                    outage.stopped.set();
                    outage.wait(&status).await?;
                }
                Err(status) => outage.wait(&status).await?,
            }
        }
    }

    /// Declares a mesh, which waits to be served. Repeated when the server is lost: an id of its own lets
    /// the server know the mesh again.
    pub fn create(
        &self,
        oracle: &dyn Oracle,
        epsilon: f64,
        options: &MeshOptions,
    ) -> Result<MeshInfo, Error> {
        self.create_from(self.spec(&Checked::new(oracle)?, epsilon, options))
    }

    pub(crate) fn spec(&self, oracle: &Checked, epsilon: f64, options: &MeshOptions) -> MeshSpec {
        options.spec(oracle, epsilon, !stays_on_this_machine(&self.address))
    }

    pub(crate) fn create_from(&self, spec: MeshSpec) -> Result<MeshInfo, Error> {
        let [high, low] = [(); 2].map(|()| RandomState::new().build_hasher().finish());
        let mesh_id = format!("{high:016x}{low:016x}");
        let request = CreateMeshRequest { spec: Some(spec), mesh_id, ..Default::default() };
        self.runtime.block_on(self.call(&mut self.outage(), false, |mut stub| {
            let request = request.clone();
            async move { stub.create_mesh(request).await }
        }))
    }

    /// A mesh as it stands, without its geometry.
    pub fn get(&self, name: &str) -> Result<MeshInfo, Error> {
        self.runtime.block_on(self.get_async(name))
    }

    pub(crate) async fn get_async(&self, name: &str) -> Result<MeshInfo, Error> {
        let name = name.to_string();
        self.call(&mut self.outage(), false, |mut stub| {
            let request = GetMeshRequest { name: name.clone(), ..Default::default() };
            async move { stub.get_mesh(request).await }
        })
        .await
    }

    /// All meshes, oldest first, fetched page by page.
    pub fn list(&self) -> Result<Vec<MeshInfo>, Error> {
        let mut all = Vec::new();
        let mut page_token = String::new();
        loop {
            let request = ListMeshesRequest { page_token, ..Default::default() };
            let page = self.runtime.block_on(self.call(&mut self.outage(), false, |mut stub| {
                let request = request.clone();
                async move { stub.list_meshes(request).await }
            }))?;
            all.extend(page.meshes);
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(all);
            }
        }
    }

    /// Ends a mesh; what there is of it stays readable.
    pub fn cancel(&self, name: &str) -> Result<MeshInfo, Error> {
        self.runtime.block_on(self.cancel_async(name, false))
    }

    pub(crate) async fn cancel_async(&self, name: &str, once: bool) -> Result<MeshInfo, Error> {
        let name = name.to_string();
        self.call(&mut self.outage(), once, |mut stub| {
            let request = CancelMeshRequest { name: name.clone(), ..Default::default() };
            async move { stub.cancel_mesh(request).await }
        })
        .await
    }

    /// Cancels a mesh if it runs, and forgets it.
    pub fn delete(&self, name: &str) -> Result<(), Error> {
        self.runtime.block_on(self.delete_async(name, false))
    }

    pub(crate) async fn delete_async(&self, name: &str, once: bool) -> Result<(), Error> {
        let name = name.to_string();
        let mut outage = self.outage();
        let call = self.call(&mut outage, once, |mut stub| {
            let request = DeleteMeshRequest { name: name.clone(), ..Default::default() };
            async move { stub.delete_mesh(request).await }
        });
        match call.await {
            // An attempt whose answer was lost has done it.
            Err(error) if &*error.reason == "MESH_NOT_FOUND" && outage.repeats() => Ok(()),
            deleted => deleted,
        }
    }

    /// What the server is and allows.
    pub fn info(&self) -> Result<ServerInfo, Error> {
        self.runtime.block_on(self.info_async())
    }

    pub(crate) async fn info_async(&self) -> Result<ServerInfo, Error> {
        self.call(&mut self.outage(), false, |mut stub| async move {
            stub.get_server_info(GetServerInfoRequest::default()).await
        })
        .await
    }

    /// Serves a mesh with this oracle until it is over; the state that it ended in, e.g. "SUCCEEDED".
    /// What the oracle fails with is an error of kind `Raised`.
    pub fn serve(&self, oracle: &dyn Oracle, name: &str, options: &WorkerOptions) -> Result<String, Error> {
        let checked = Checked::new(oracle)?;
        self.runtime.block_on(Worker::new(self, &checked, name, options, false, Flag::default()).run())
    }

    /// Opens a stream, again where it breaks off, and hands its messages on until one is the last.
    pub(crate) async fn follow_stream<T, F>(
        &self,
        stopped: Flag,
        mut open: impl FnMut(Stub) -> F,
        mut handle: impl FnMut(Option<T>) -> Result<bool, Error>,
    ) -> Result<(), Error>
    where
        F: Future<Output = Result<Response<Streaming<T>>, Status>>,
    {
        let mut outage = Outage::new(&self.patience, false, stopped);
        loop {
            let broken = match open(self.stub.clone()).await {
                Err(status) => status,
                Ok(stream) => {
                    let mut stream = stream.into_inner();
                    loop {
                        match stream.message().await {
                            Ok(Some(message)) => {
                                outage.heard();
                                if handle(Some(message))? {
                                    return Ok(());
                                }
                            }
                            Ok(None) => break Status::unavailable("the stream ended too early"),
                            Err(status) => break status,
                        }
                    }
                }
            };
            outage.wait(&broken).await?;
            handle(None)?; // what was incomplete will come again
        }
    }
}
