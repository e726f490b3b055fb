"""The kit's server: it hands every call to the scenario that is on, and records it."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from concurrent import futures
from typing import Any

import grpc
from stellate._generated import oracle_pb2 as pb
from stellate._generated import stellate_pb2
from stellate._generated import stellate_pb2_grpc as rpc

from .recorder import Call, Recorder
from .scenario import Refusal, Scenario

_LARGEST_MESSAGE = 64 << 20
_DONE = object()


class Silence(Exception):
    """Nothing came in time, or the stream ended where something should have come."""


class Stream:
    """A worker's stream, as a script sees it: say and hear in turn."""

    def __init__(self, requests: Iterator[pb.ServeOracleRequest], call: Call) -> None:
        self._requests, self._call = requests, call
        self._in: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._out: queue.SimpleQueue[Any] = queue.SimpleQueue()
        threading.Thread(target=self._read, daemon=True).start()

    def say(self, **kind: Any) -> None:
        self._out.put(pb.ServeOracleResponse(**kind))

    def say_raw(self, message: bytes) -> None:
        """What only a newer server would say."""
        self._out.put(pb.ServeOracleResponse.FromString(message))

    def end(self, refusal: Refusal | None = None) -> None:
        self._out.put(_DONE if refusal is None else refusal)

    def hear(self, seconds: float) -> pb.ServeOracleRequest | None:
        """The next message; None: the client said that it will say no more. Raises: Silence."""
        try:
            said = self._in.get(timeout=seconds)
        except queue.Empty:
            raise Silence(f"nothing came within {seconds:g} s") from None
        if said is _DONE:
            return None
        if isinstance(said, Silence):
            raise said
        return said

    def _read(self) -> None:
        try:
            for request in self._requests:
                self._call.came(request)
                self._in.put(request)
            self._call.client_done()
            self._in.put(_DONE)
        except Exception:  # gRPC's own kinds: the client cancelled, or is gone
            self._in.put(Silence("the client cancelled its stream, or went away"))

    def outgoing(self) -> Iterator[pb.ServeOracleResponse]:
        """Raises: Refusal."""
        while (said := self._out.get()) is not _DONE:
            if isinstance(said, Refusal):
                raise said
            yield said


class Service(rpc.StellateServicer):
    """One scenario at a time."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder
        self.scenario: Scenario | None = None

    def GetServerInfo(self, request: Any, context: Any) -> Any:
        info = stellate_pb2.ServerInfo(version="conform", protocols=["stellate.v1"])
        if self.scenario is not None:
            info.max_message_bytes = self.scenario.max_message_bytes
        return self._once("GetServerInfo", request, context, lambda: info)

    def CreateMesh(self, request: Any, context: Any) -> Any:
        metadata = {key: value for key, value in context.invocation_metadata()}
        return self._once(
            "CreateMesh", request, context, lambda: self._on().create(request, metadata)
        )

    def GetMesh(self, request: Any, context: Any) -> Any:
        return self._once("GetMesh", request, context, lambda: self._on().get())

    def CancelMesh(self, request: Any, context: Any) -> Any:
        return self._once("CancelMesh", request, context, lambda: self._on().get())

    def DeleteMesh(self, request: Any, context: Any) -> Any:
        from google.protobuf import empty_pb2

        return self._once("DeleteMesh", request, context, empty_pb2.Empty)

    def Reconstruct(self, requests: Any, context: Any) -> Any:
        call = self._recorder.begin("Reconstruct")

        def noted() -> Iterator[Any]:
            for request in requests:
                call.came(request)
                yield request
            call.client_done()

        return list(_told(call, context, lambda: [self._on().upload(noted())]))[0]

    def DownloadMesh(self, request: Any, context: Any) -> Any:
        call = self._recorder.begin("DownloadMesh")
        call.came(request)
        yield from _told(call, context, lambda: self._on().download(request))

    def WatchMesh(self, request: Any, context: Any) -> Any:
        call = self._recorder.begin("WatchMesh")
        call.came(request)
        yield from _told(call, context, lambda: self._on().watch(request))

    def ServeOracle(self, requests: Any, context: Any) -> Any:
        call = self._recorder.begin("ServeOracle")
        stream = Stream(requests, call)

        def script() -> None:
            try:
                self._on().serve(stream)
            except Refusal as refusal:
                stream.end(refusal)
            else:
                stream.end()

        threading.Thread(target=script, daemon=True).start()
        yield from _told(call, context, stream.outgoing)

    def _on(self) -> Scenario:
        if self.scenario is None:
            raise Refusal(grpc.StatusCode.UNAVAILABLE, "the kit has come to its end")
        return self.scenario

    def _once(self, method: str, request: Any, context: Any, answer: Any) -> Any:
        call = self._recorder.begin(method)
        call.came(request)
        return list(_told(call, context, lambda: [answer()]))[0]


def _told(call: Call, context: Any, answers: Any) -> Iterator[Any]:
    try:
        for message in answers():
            call.sent(message)
            yield message
    except Refusal as refusal:
        call.ended(refusal.code.value[0], refusal.words, refusal.details)
        if refusal.details:
            context.set_trailing_metadata((("grpc-status-details-bin", refusal.details),))
        context.abort(refusal.code, refusal.words)
    else:
        call.ended()


def start(service: Service) -> tuple[grpc.Server, int]:
    """The server and its port, on the loopback. Raises: OSError."""
    options = [
        ("grpc.max_receive_message_length", _LARGEST_MESSAGE),
        ("grpc.http2.min_recv_ping_interval_without_data_ms", 100),
        ("grpc.keepalive_permit_without_calls", 1),
    ]
    server = grpc.server(futures.ThreadPoolExecutor(32), options=options)
    rpc.add_StellateServicer_to_server(service, server)
    port = server.add_insecure_port("127.0.0.1:0")
    server.start()
    return server, port
