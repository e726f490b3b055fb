"""The service call by call, for those who need more than stellate.mesh."""

from __future__ import annotations

import re
import secrets
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Callable, TypeVar

import grpc

from ._check import examine
from ._chunks import Declared, Puller
from ._credentials import Credentials, stays_on_this_machine
from ._epsilon import Epsilon, choose
from ._findings import CheckReport
from ._generated import mesh_pb2
from ._generated import stellate_pb2 as pb
from ._generated import stellate_pb2_grpc as rpc
from ._info import MeshInfo, ServerInfo
from ._points import CheckedPoints
from ._reconnect import WAITS, Reconnector, ReconnectPolicy
from ._saved import SavedMesh
from ._shared import text
from ._streams import Parts, Watch
from ._trace import trace_headers
from ._upload import Upload
from ._wire.spec import mesh_spec
from ._worker import Ask, Worker, answer
from .errors import InvalidArgument, MeshNotFound, StellateError, from_rpc
from .options import SpecOptions, takes
from .oracle import CheckedOracle
from .server import Server

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = ["Client", "MeshInfo", "SavedMesh", "ServerInfo", "Watch", "Parts"]

_NO_PINGS = 1_000_000.0
_LARGEST_MESSAGE = 64 << 20

T = TypeVar("T")


class Client:
    """A connection to a server. A context manager; any thread may use it.

    Args:
      server: "host:port", "unix:/path", a stellate.Server, or None for a Server of its own.
      credentials: TLS and a token, for a server that wants them.
      reconnect_seconds: how long a server that was there and went away is waited for; 0: not at
        all. Calls are repeated where that does no harm, and streams carried on where they broke
        off. It has to remember its meshes (stellated --data-dir). A server that cannot be reached
        in the first place, or refuses, is an error immediately. The logger "stellate" reports it.
      keepalive_seconds: how long a silent server is trusted before it is pinged; it has twice as
        long to answer.
    """

    def __init__(
        self,
        server: str | Server | None = None,
        credentials: Credentials | None = None,
        *,
        reconnect_seconds: float = WAITS["give_up"],
        keepalive_seconds: float = WAITS["keepalive"],
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
        if not address.startswith("unix:") and not re.fullmatch(r"[^/]*:[0-9]+", address):
            raise InvalidArgument(
                f"server has to be 'host:port' or 'unix:/path', and is {address!r}"
            )
        self.address = address
        # A private server needs no pings: its end shows immediately.
        private = isinstance(self._server, Server) and self._server.private
        ping = max(1, int(1000 * (_NO_PINGS if private else keepalive_seconds)))
        lost = int(WAITS["ping_patience"] * ping)
        options = [
            ("grpc.max_receive_message_length", _LARGEST_MESSAGE),
            ("grpc.max_send_message_length", _LARGEST_MESSAGE),
            ("grpc.keepalive_time_ms", ping),
            ("grpc.keepalive_timeout_ms", lost),
            ("grpc.http2.ping_timeout_ms", lost),  # the same to newer libraries: else a minute
            ("grpc.http2.max_pings_without_data", 0),  # as many as it takes
            # The pauses between attempts are ours; gRPC's own would be up to two minutes.
            ("grpc.initial_reconnect_backoff_ms", int(1000 * WAITS["first_connection_pause"])),
            ("grpc.max_reconnect_backoff_ms", int(1000 * WAITS["longest_connection_pause"])),
            ("grpc.service_config", text("retries.json")),  # a reply that was lost on the way
        ]
        if address.startswith(("unix:", "localhost:", "127.", "[::1]:")):
            options.append(("grpc.enable_http_proxy", 0))  # proxies are for the outside
        self._channel = (credentials or Credentials()).channel(address, options)
        self._stub = rpc.StellateStub(self._channel)
        self._policy = ReconnectPolicy(reconnect_seconds, self._connect, self._why_hopeless)

    @takes(SpecOptions)
    def create(
        self, oracle: Any, epsilon: Epsilon | None = None, **options: Unpack[SpecOptions]
    ) -> MeshInfo:
        """Declares a mesh, which waits to be served. epsilon, required, and options: see stellate.mesh.

        When the server is lost it is repeated: an id of its own lets the server know the mesh again.
        """
        checked = oracle if isinstance(oracle, CheckedOracle) else CheckedOracle(oracle)
        if options.get("speculative") is None and not stays_on_this_machine(self.address):
            options["speculative"] = True  # round trips are what a far server costs
        spec = mesh_spec(checked, choose(oracle, epsilon, self.check)[0], options)
        request = pb.CreateMeshRequest(spec=spec, mesh_id=secrets.token_hex(16))
        return MeshInfo.from_wire(self._call(self._stub.CreateMesh, request))

    def check(self, oracle: Any, epsilon: float | None = None, *, seed: int = 1) -> CheckReport:
        """Probes an oracle for its contract: see stellate.check."""
        return examine(self, self._stub, oracle, epsilon, seed)

    def declare_points(self, points: CheckedPoints) -> MeshInfo:
        """Declares a mesh of points, which waits for them. See stellate.reconstruct.

        Not repeated when the server is lost: whether it made the mesh would not be known.
        """
        chunks = iter([pb.PointsChunk(spec=points.spec)])
        attempts = Reconnector(self._policy)
        try:
            reply = self._stub.Reconstruct(chunks, timeout=WAITS["call"], metadata=trace_headers())
        except grpc.RpcError as error:
            attempts.stop()
            attempts.wait_or_raise(error, from_rpc(error))
            raise  # not reached: the attempts are stopped
        attempts.heard()
        return MeshInfo.from_wire(reply.mesh)

    def upload(self, name: str, points: CheckedPoints, rows: int | None = None) -> Upload:
        """What sends the points of a mesh that was declared so, `rows` at a time, for a thread to run.

        After a break, of the connection or of an earlier upload, it goes on from what the server has.
        """
        most = self.info().max_message_bytes
        attempts = Reconnector(self._policy, quiet=True)  # the watch tells
        return Upload(self._stub, attempts, name, points.points, points.tangents, most, rows)

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

    def cancel(self, name: str, *, wait: bool = True) -> MeshInfo:
        """Ends a mesh; what there is of it stays readable. No effect when it is over.

        Without `wait` a lost server is an error.
        """
        request = pb.CancelMeshRequest(name=name)
        return MeshInfo.from_wire(self._call(self._stub.CancelMesh, request, once=not wait))

    def delete(self, name: str, *, wait: bool = True) -> None:
        """Cancels a mesh if it runs, and forgets it. Without `wait` a lost server is an error."""
        attempts = Reconnector(self._policy)
        request = pb.DeleteMeshRequest(name=name)
        try:
            self._call(self._stub.DeleteMesh, request, attempts, once=not wait)
        except MeshNotFound:
            if not attempts.lasts:  # else an attempt whose answer was lost has done it
                raise

    def info(self) -> ServerInfo:
        """What the server is and allows."""
        return ServerInfo.from_wire(self._call(self._stub.GetServerInfo, pb.GetServerInfoRequest()))

    def serve(
        self, oracle: Any, name: str, *, worker: str = "", max_chunk: int | None = None
    ) -> str:
        """Serves a mesh with this oracle until it is over; returns the state it ended in.

        `max_chunk`: the most points in one call of the oracle; None: as many as take it a
        quarter of a second, or four times what a call of it costs.

        Raises: what the oracle raises, or StellateError.
        """
        return self.worker(oracle, name, worker, max_chunk=max_chunk).run()

    def worker(
        self,
        oracle: Any,
        name: str,
        worker: str = "",
        on_failure: Callable[[BaseException], None] = lambda error: None,
        *,
        quiet: bool = False,
        ask: Ask = answer,
        max_chunk: int | None = None,
    ) -> Worker:
        """A worker for a thread of its own; `on_failure` is called with an exception of the oracle.

        A `quiet` one leaves it to others to log that the server is lost. `ask` has the oracle
        answer a chunk of questions, somewhere else perhaps: see stellate.executors.workers_on.
        """
        checked = oracle if isinstance(oracle, CheckedOracle) else CheckedOracle(oracle)
        return Worker(
            self._stub, checked, name, worker, on_failure, self._policy, quiet, ask, max_chunk
        )

    def pull(
        self,
        name: str,
        *,
        worker: str = "",
        max_chunk: int | None = None,
        intersect_flat: bool | None = None,
        tangent_basis: bool | None = None,
        local_size: bool | None = None,
        walls: int | None = None,
    ) -> Puller:
        """Serves a mesh from a loop of the caller's, on the caller's own thread: see stellate.pulling.

        `intersect_flat`, `tangent_basis`, `local_size`, `walls`: what answers can have, where that is
        to be compared with what the mesh was declared with; without any it is all of that.
        """
        can = {
            "intersect_flat": intersect_flat,
            "tangent_basis": tangent_basis,
            "local_size": local_size,
            "walls": walls,
        }
        given = {name: value for name, value in can.items() if value is not None}
        puller, declared = Puller(), Declared.of(self.get_spec(name), **given)
        return puller.serve(
            self.worker(declared, name, worker, ask=puller.ask, max_chunk=max_chunk)
        )

    def watch(self, name: str, from_revision: int = 0, progress_only: bool = False) -> Watch:
        """The mesh's events as they come, in the protocol's own messages."""
        attempts = Reconnector(self._policy)
        return Watch(self._stub, attempts, name, from_revision, progress_only)

    def parts(self, name: str, revision: int = 0) -> Parts:
        """A mesh as it was at one revision, 0 being the newest, in the protocol's own messages.

        See stellate.download for the mesh itself.
        """
        return Parts(self._stub, Reconnector(self._policy), name, revision)

    def get_spec(self, name: str) -> mesh_pb2.MeshSpec:
        """The specification in the protocol's own message."""
        return self._call(self._stub.GetMesh, pb.GetMeshRequest(name=name)).spec

    def _connect(self) -> None:
        try:
            self._stub.GetServerInfo(
                pb.GetServerInfoRequest(), timeout=WAITS["connect"], wait_for_ready=True
            )
        except grpc.RpcError:
            pass  # what is wrong the next attempt will tell

    def _why_hopeless(self) -> StellateError | None:
        """The end of our own server, which will not be started again."""
        if isinstance(self._server, Server) and not self._server.alive:
            return self._server.why_gone()
        return None

    def close(self) -> None:
        """Closes the connection, and stops the server if it is this client's own."""
        self._channel.close()
        if self._own_server is not None:
            self._own_server.close()

    def _call(
        self,
        method: Callable[..., T],
        request: Any,
        attempts: Reconnector | None = None,
        *,
        once: bool = False,
    ) -> T:
        attempts = attempts or Reconnector(self._policy)
        while True:
            try:
                answer = method(request, timeout=WAITS["call"], metadata=trace_headers())
            except grpc.RpcError as error:
                if once:
                    attempts.stop()
                attempts.wait_or_raise(error, from_rpc(error))
            else:
                attempts.heard()
                return answer

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()
