"""The service call by call, for those who need more than stellate.mesh."""

from __future__ import annotations

import dataclasses
import datetime
import time
from types import TracebackType
from typing import Any, Callable, Iterator, TypeVar

import grpc

from ._credentials import Credentials
from ._generated import mesh_pb2
from ._generated import stellate_pb2 as pb
from ._generated import stellate_pb2_grpc as rpc
from ._server import Server
from ._spec import mesh_spec
from ._worker import Worker
from .errors import InvalidArgument, StellateError, Unavailable, from_rpc
from .oracle import CheckedOracle
from .report import Progress, Report

_CALL_SECONDS = 30.0
_RETRY_PAUSES = (0.1, 0.2, 0.5, 1.0, 2.0, 4.0)
_LARGEST_MESSAGE = 64 << 20

T = TypeVar("T")


@dataclasses.dataclass(frozen=True)
class MeshInfo:
    """A mesh on the server, without its geometry."""

    name: str  # "meshes/<unguessable>"
    state: str  # "WAITING", "RUNNING", "SUCCEEDED", "STOPPED", "CANCELLED" or "FAILED"
    label: str
    dimension: int
    ambient_dimension: int
    epsilon: float
    create_time: datetime.datetime | None
    end_time: datetime.datetime | None
    revision: int
    progress: Progress
    report: Report | None  # once it is over
    workers: int
    watchers: int

    @property
    def over(self) -> bool:
        """Whether nothing will change any more."""
        return self.state not in ("WAITING", "RUNNING")

    @classmethod
    def from_wire(cls, mesh: mesh_pb2.Mesh) -> MeshInfo:
        def at(field: str) -> datetime.datetime | None:
            if not mesh.HasField(field):
                return None
            return getattr(mesh, field).ToDatetime(tzinfo=datetime.timezone.utc)

        return cls(
            name=mesh.name,
            state=mesh_pb2.MeshState.Name(mesh.state).removeprefix("MESH_STATE_"),
            label=mesh.spec.label,
            dimension=mesh.spec.dimension,
            ambient_dimension=mesh.spec.ambient_dimension,
            epsilon=mesh.spec.epsilon,
            create_time=at("create_time"),
            end_time=at("end_time"),
            revision=mesh.revision,
            progress=Progress.from_wire(mesh.progress),
            report=Report.from_wire(mesh.report) if mesh.HasField("report") else None,
            workers=mesh.workers,
            watchers=mesh.watchers,
        )


@dataclasses.dataclass(frozen=True)
class ServerInfo:
    """What a server is and allows."""

    version: str
    protocols: tuple[str, ...]
    max_dimension: int
    max_ambient_dimension: int
    max_vertices: int
    max_rounds: int
    max_meshes: int
    max_message_bytes: int


class Client:
    """A connection to a server. A context manager; any thread may use it.

    Args:
      server: "host:port", "unix:/path", a stellate.Server, or None for a Server of its own.
      credentials: TLS and a token, for a server that wants them.
    """

    def __init__(
        self, server: str | Server | None = None, credentials: Credentials | None = None
    ) -> None:
        if server is None and credentials is not None:
            raise InvalidArgument("credentials are for a server: say which")
        self._own_server = Server() if server is None else None
        self._server = self._own_server if server is None else server
        if not isinstance(self._server, (str, Server)) or self._server == "":
            raise InvalidArgument(
                f"server has to be 'host:port' or 'unix:/path', and is {server!r}"
            )
        address = self._server.address if isinstance(self._server, Server) else self._server
        self.address = address
        options = [
            ("grpc.max_receive_message_length", _LARGEST_MESSAGE),
            ("grpc.max_send_message_length", _LARGEST_MESSAGE),
            ("grpc.keepalive_time_ms", 20_000),
            ("grpc.keepalive_timeout_ms", 10_000),
        ]
        if address.startswith(("unix:", "localhost:", "127.", "[::1]:")):
            options.append(("grpc.enable_http_proxy", 0))  # proxies are for the outside
        self._channel = (credentials or Credentials()).channel(address, options)
        self._stub = rpc.StellateStub(self._channel)

    def create(self, oracle: Any, epsilon: float = 0.1, **criteria: Any) -> MeshInfo:
        """Declares a mesh, which waits to be served. Keywords: see stellate.mesh."""
        checked = oracle if isinstance(oracle, CheckedOracle) else CheckedOracle(oracle)
        spec = mesh_spec(checked, epsilon, criteria)
        return MeshInfo.from_wire(
            self._call(self._stub.CreateMesh, pb.CreateMeshRequest(spec=spec))
        )

    def get(self, name: str) -> MeshInfo:
        """A mesh as it stands. Raises MeshNotFound."""
        return MeshInfo.from_wire(self._call(self._stub.GetMesh, pb.GetMeshRequest(name=name)))

    def list(self, page_size: int = 0) -> Iterator[MeshInfo]:
        """All meshes, oldest first, fetched page by page."""
        request = pb.ListMeshesRequest(page_size=page_size)
        while True:
            page = self._call(self._stub.ListMeshes, request)
            yield from map(MeshInfo.from_wire, page.meshes)
            if not page.next_page_token:
                return
            request.page_token = page.next_page_token

    def cancel(self, name: str) -> MeshInfo:
        """Ends a mesh; what there is of it stays readable. No effect when it is over."""
        return MeshInfo.from_wire(
            self._call(self._stub.CancelMesh, pb.CancelMeshRequest(name=name))
        )

    def delete(self, name: str) -> None:
        """Cancels a mesh if it runs, and forgets it."""
        self._call(self._stub.DeleteMesh, pb.DeleteMeshRequest(name=name))

    def info(self) -> ServerInfo:
        """What the server is and allows."""
        answer = self._call(self._stub.GetServerInfo, pb.GetServerInfoRequest())
        plain = (
            field.name for field in dataclasses.fields(ServerInfo) if field.name != "protocols"
        )
        values: dict[str, Any] = {name: getattr(answer, name) for name in plain}
        return ServerInfo(protocols=tuple(answer.protocols), **values)

    def serve(self, oracle: Any, name: str, *, worker: str = "") -> str:
        """Serves a mesh with this oracle until it is over; returns the state it ended in.

        Raises: what the oracle raises, or StellateError.
        """
        return self.worker(oracle, name, worker).run()

    def worker(
        self,
        oracle: Any,
        name: str,
        worker: str = "",
        on_failure: Callable[[BaseException], None] = lambda error: None,
    ) -> Worker:
        """A worker for a thread of its own; `on_failure` is told of an exception of the oracle."""
        checked = oracle if isinstance(oracle, CheckedOracle) else CheckedOracle(oracle)
        return Worker(self._stub, checked, name, worker, on_failure)

    def watch(self, name: str, from_revision: int = 0, progress_only: bool = False) -> Watch:
        """The mesh's events as they come, in the protocol's own messages."""
        return Watch(self, self._stub, name, from_revision, progress_only)

    def get_spec(self, name: str) -> mesh_pb2.MeshSpec:
        """The specification in the protocol's own message."""
        return self._call(self._stub.GetMesh, pb.GetMeshRequest(name=name)).spec

    def lost(self, error: StellateError) -> StellateError:
        """A better error than `error` if what is behind it is the death of our own server."""
        if isinstance(error, Unavailable) and isinstance(self._server, Server):
            if not self._server.alive:
                return self._server.why_gone()
        return error

    def close(self) -> None:
        """Closes the connection, and stops the server if it is this client's own."""
        self._channel.close()
        if self._own_server is not None:
            self._own_server.close()

    def _call(self, method: Callable[..., T], request: Any) -> T:
        try:
            # Refused connections are errors at once, except while the first one is being made.
            return method(request, timeout=_CALL_SECONDS)
        except grpc.RpcError as error:
            raise self.lost(from_rpc(error)) from None

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class Watch:
    """An iterator over WatchMeshResponse messages that survives a lost connection.

    After a break it goes on from the last complete revision; chunks of an incomplete one are sent
    again, which `on_resume` announces.
    """

    def __init__(
        self,
        client: Client,
        stub: rpc.StellateStub,
        name: str,
        from_revision: int,
        progress_only: bool,
    ) -> None:
        self._client, self._stub = client, stub
        self._request = pb.WatchMeshRequest(
            name=name, from_revision=from_revision, progress_only=progress_only
        )
        self._stream: Any = None
        self._failures = 0
        self._over = False
        self.on_resume: Callable[[], None] = lambda: None

    def __iter__(self) -> Watch:
        return self

    def __next__(self) -> pb.WatchMeshResponse:
        while not self._over:
            try:
                if self._stream is None:
                    self._stream = self._stub.WatchMesh(self._request)
                event = next(self._stream)
            except grpc.RpcError as error:
                self._stream = None
                self._pause_or_raise(from_rpc(error))
                continue
            self._failures = 0
            kind = event.WhichOneof("event")
            if kind == "delta" and event.delta.complete:
                self._request.from_revision = event.delta.delta.revision
            self._over = kind == "final"
            return event
        raise StopIteration

    def close(self) -> None:
        """Stops watching; the mesh goes on."""
        self._over = True
        if self._stream is not None:
            self._stream.cancel()

    def _pause_or_raise(self, error: StellateError) -> None:
        error = self._client.lost(error)
        resumable = isinstance(error, Unavailable) and error.reason != "SERVER_GONE"
        if not resumable or self._failures >= len(_RETRY_PAUSES):
            raise error from None
        time.sleep(_RETRY_PAUSES[self._failures])
        self._failures += 1
        self.on_resume()
