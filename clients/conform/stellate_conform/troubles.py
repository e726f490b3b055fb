"""The rules of workers in trouble: oracles that fail or are slow, servers that go away."""

from __future__ import annotations

import time
from typing import Any, Callable

import grpc
import numpy as np
from stellate._generated import mesh_pb2

from .scenario import Refusal, Scenario, agree
from .server import Silence, Stream
from .worker import Answers, Flats, OtherWalls, Partly, Serving, Walls, manifold

# Long enough for a busy machine; a client that leaves all waiting to its channel takes 20 and more.
_COMES_BACK_SECONDS = 15.0
_FROZEN_SECONDS = 30.0


class Raises(Serving):
    """An oracle that fails."""

    name, manifold = "worker", "raises"
    rules = ("tells-of-its-failure", "raises-it-to-its-owner")

    def script(self, stream: Stream) -> None:
        self.welcome(stream)
        chunk = self.question(self.near(4), tangents=True)
        stream.say(queries=chunk)
        said = self.reply(stream)
        kind = "the end of the stream" if said is None else said.WhichOneof("message")
        good = said is not None and kind == "failure" and "on purpose" in said.failure.message
        good = good and said.failure.lease == chunk.lease
        wanted = f"OracleFailure of lease {chunk.lease} that says `on purpose`"
        self.judge("tells-of-its-failure", good, f"{kind}: {said}".replace("\n", " "), wanted)
        raise Refusal(grpc.StatusCode.ABORTED, "raised on purpose", "ORACLE_FAILED")

    def hear(self, answer: str) -> None:
        good = agree(answer, "error oracleerror") and self.streams == 1
        came = f"`{answer}` after {self.streams} streams"
        self.judge("raises-it-to-its-owner", good, came, "`error oracleerror ...` after one stream")


class Refused(Serving):
    """A stream that ends with an error after which nobody should come back."""

    rules = ("says-why", "stays-away")
    code, reason, words = grpc.StatusCode.INVALID_ARGUMENT, "", ""

    def script(self, stream: Stream) -> None:
        self.welcome(stream)
        stream.say(queries=self.question(self.near(2), tangents=True))
        self.reply(stream)
        raise Refusal(self.code, self.words, self.reason, lease="1", row="0")

    def hear(self, answer: str) -> None:
        wanted = f"error oracleerror {self.reason}"
        self.judge("says-why", agree(answer, wanted), f"`{answer}`", f"`{wanted}`")
        came = f"{self.streams} streams"
        self.judge("stays-away", self.streams == 1, came, "one stream: its answers were wrong")


class BadAnswer(Refused):
    name, reason = "worker.bad-answer", "ORACLE_NOT_FINITE"
    words = "closest_point query 0: the answer's point is nan in coordinate 0 (lease 1, row 0)"


class AlreadyOver(Serving):
    """A mesh that is over before the worker comes."""

    name = "worker.mesh-is-over"
    rules = ("stays-away",)

    def script(self, stream: Stream) -> None:
        stream.hear(self.patience)
        raise Refusal(
            grpc.StatusCode.FAILED_PRECONDITION, "the mesh is over", "FAILED_PRECONDITION"
        )

    def get(self) -> mesh_pb2.Mesh:
        mesh = super().get()
        mesh.state = mesh_pb2.MESH_STATE_SUCCEEDED
        mesh.end_time.GetCurrentTime()
        return mesh

    def hear(self, answer: str) -> None:
        ways = ("over SUCCEEDED", "error failedprecondition FAILED_PRECONDITION")
        good = any(agree(answer, way) for way in ways)
        came = f"`{answer}` after {self.streams} streams"
        wanted = "how the mesh ended, or FAILED_PRECONDITION, after one stream"
        self.judge("stays-away", good and self.streams == 1, came, wanted)


class Outage(Serving):
    """A server that goes away with a chunk open, and comes back."""

    rules = ("comes-back", "says-hello-again", "ends-with-the-mesh")
    within = _COMES_BACK_SECONDS

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.lost_at = 0.0
        self.lose: Callable[[], None] = lambda: None

    def script(self, stream: Stream) -> None:
        if self.streams > 1:
            took = time.monotonic() - self.lost_at
            came, wanted = f"after {took:.1f} s", f"a new stream within {self.within:g} s"
            self.judge("comes-back", took <= self.within, came, wanted)
            self.welcome(stream)
            self.judge("says-hello-again", True)
            problem = self.answered(stream, self.question(self.near(5), tangents=True))
            if not problem:
                self.finish(stream)
            return
        self.welcome(stream)
        problem = self.answered(stream, self.question(self.near(1), tangents=True))
        if problem:
            raise Refusal(grpc.StatusCode.INVALID_ARGUMENT, problem, "ORACLE_SHAPE")
        self.lost_at = time.monotonic()
        self.depart(stream)

    def depart(self, stream: Stream) -> None:
        raise Refusal(grpc.StatusCode.UNAVAILABLE, "the server is stopping", "SHUTTING_DOWN")


class Stopping(Outage):
    name = "worker.server-stops"


class Gone(Outage):
    """Its connections break, and for a while no server listens."""

    name = "worker.server-gone"

    def depart(self, stream: Stream) -> None:
        self.lose()
        raise Refusal(grpc.StatusCode.UNAVAILABLE, "nobody hears this")


class Frozen(Outage):
    """It falls silent, as a frozen one does: only pings find out."""

    name = "worker.server-frozen"
    within = _FROZEN_SECONDS

    def depart(self, stream: Stream) -> None:
        self.lose()


class Slow(Serving):
    """An oracle that takes two seconds over a batch, on a server that bears one of silence."""

    name, manifold, answer_seconds = "worker.slow", "slow", 1.0
    rules = ("says-busy", "ends-with-the-mesh")

    def script(self, stream: Stream) -> None:
        self.welcome(stream)
        chunk = self.question(self.near(3), tangents=True)
        stream.say(queries=chunk)
        times = [time.monotonic()]
        while (said := stream.hear(self.patience)) is not None:
            times.append(time.monotonic())
            if said.WhichOneof("message") != "busy":
                break
            if said.busy.lease != chunk.lease:
                self.judge("says-busy", False, f"Busy of lease {said.busy.lease}")
        problem = self.wrong(chunk, said)
        silence = max(np.diff(times), default=0.0)
        came = problem or f"silent for {silence:.1f} s"
        self.judge("says-busy", not problem and silence < 1, came, "Busy four times a second")
        self.finish(stream)


class SlowOnOldServer(Serving):
    """A server of a time before Busy."""

    name, manifold, answer_seconds = "worker", "slow", 0.0
    rules = ("no-busy-to-an-old-server",)

    def script(self, stream: Stream) -> None:
        self.welcome(stream)
        chunk = self.question(self.near(3), tangents=True)
        stream.say(queries=chunk)
        said = stream.hear(self.patience)
        problem = self.wrong(chunk, said)
        self.judge("no-busy-to-an-old-server", not problem, problem, "the answer, and no Busy")
        self.finish(stream)

    def hear(self, answer: str) -> None:
        pass


class OverTooEarly(Serving):
    """The mesh ends while a chunk is open."""

    name, manifold = "worker", "slow"
    rules = ("mesh-over-with-a-chunk-open",)

    def converse(self, stream: Stream) -> None:
        stream.say(queries=self.question(self.near(3), tangents=True))
        try:
            stream.hear(0.5)  # until it is at it
        except Silence:
            pass

    def hear(self, answer: str) -> None:
        good = answer == "over SUCCEEDED" and self.streams == 1
        came = f"`{answer}` after {self.streams} streams"
        self.judge("mesh-over-with-a-chunk-open", good, came, "`over SUCCEEDED`")


SCENARIOS: tuple[type[Scenario], ...] = (
    Answers, manifold("clifford"), manifold("so3"), manifold("circle:64"), manifold("circle:4096"),
    Partly, Flats, Walls, OtherWalls, Raises, BadAnswer, AlreadyOver, OverTooEarly, Slow, SlowOnOldServer, Stopping,
    Gone, Frozen,
)  # fmt: skip
