"""A collector of OpenTelemetry, which reads what it gets with OpenTelemetry's own messages."""

from __future__ import annotations

import concurrent.futures
import contextlib
import os
import pathlib
import socket
import sys
import threading
from collections.abc import Iterator

import grpc
import pytest
from opentelemetry.proto.collector.trace.v1 import trace_service_pb2, trace_service_pb2_grpc

_ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(_ROOT / "clients" / "python"))


class Collector(trace_service_pb2_grpc.TraceServiceServicer):
    """Keeps spans, as (resource, span). With `answers` cleared it takes calls, and does not reply."""

    def __init__(self) -> None:
        self.spans: list = []
        self.headers: list[dict[str, str]] = []
        self.answers = threading.Event()
        self.answers.set()
        self.came = threading.Condition()
        # Threads enough for what is not answered.
        self._server = grpc.server(concurrent.futures.ThreadPoolExecutor(8))
        trace_service_pb2_grpc.add_TraceServiceServicer_to_server(self, self._server)
        self.url = f"http://127.0.0.1:{self._server.add_insecure_port('127.0.0.1:0')}"
        self._server.start()

    def Export(self, request, context):
        with self.came:
            self.headers.append(dict(context.invocation_metadata()))
            for group in request.resource_spans:
                for scope in group.scope_spans:
                    self.spans += [(group.resource, span) for span in scope.spans]
            self.came.notify_all()
        self.answers.wait()
        return trace_service_pb2.ExportTraceServiceResponse()

    def named(self, name: str) -> list:
        with self.came:
            return [span for _, span in self.spans if span.name == name]

    def wait_for(self, name: str, count: int = 1) -> list:
        with self.came:
            self.came.wait_for(lambda: sum(s.name == name for _, s in self.spans) >= count)
        return self.named(name)

    def close(self) -> None:
        self.answers.set()
        self._server.stop(None)


@pytest.fixture
def collector():
    running = Collector()
    yield running
    running.close()


def free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


@contextlib.contextmanager
def stranger(kind: str) -> Iterator[str]:
    """The URL of what is no collector: nothing listens there ("away"), or what does is "mute", or sends
    "garbage" for as long as it is read."""
    if kind == "away":
        yield f"http://127.0.0.1:{free_port()}"
        return
    with socket.create_server(("127.0.0.1", 0)) as listening:
        threading.Thread(target=_receive, args=(listening, kind), daemon=True).start()
        yield f"http://127.0.0.1:{listening.getsockname()[1]}"
        listening.shutdown(socket.SHUT_RDWR)  # wakes the thread


def _receive(listening: socket.socket, kind: str) -> None:
    callers = []  # kept open
    while True:
        try:
            callers.append(listening.accept()[0])
        except OSError:
            return
        if kind == "garbage":
            with contextlib.suppress(OSError):
                while True:
                    callers[-1].sendall(os.urandom(65536))
