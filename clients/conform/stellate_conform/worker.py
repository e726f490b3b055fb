"""The rules of those who answer: each scenario is a mesh that a worker serves."""

from __future__ import annotations

import threading
from typing import Any

import grpc
import numpy as np
from stellate._generated import oracle_pb2 as pb
from stellate._wire.arrays import from_wire, to_wire

from . import manifolds
from .scenario import Refusal, Scenario, agree
from .server import Silence, Stream

_CHUNK_BYTES = 1_000_000  # of the arrays of a chunk, as of those of its answer
_NEWER = b"\x9a\x06\x02hi"  # a field of the number 99: nobody knows it
_NEWER_MESSAGE = b"\x7a\x02hi"  # a kind of message of the number 15


class Serving(Scenario):
    """The server's side of one mesh; script() is its conversation on the n-th stream."""

    manifold = "torus"
    answer_seconds = 60.0

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.oracle = manifolds.make(self.manifold)
        self.rng = np.random.default_rng(7)
        self.streams, self.leases, self.max_chunk = 0, 0, 0
        self.scripts: list[threading.Event] = []
        self.spec.dimension = self.oracle.dimension
        self.spec.ambient_dimension = self.oracle.ambient_dimension
        able = self.spec.oracle
        able.tangent_basis = True
        able.intersect_flat = self.manifold == "sphere"
        able.local_size = self.manifold == "sphere"
        self.spec.walls = getattr(self.oracle, "walls", 0)
        able.conormals = self.spec.walls > 0

    @property
    def line(self) -> str:
        return f"serve {self.mesh} {self.manifold}"

    def serve(self, stream: Stream) -> None:
        self.streams += 1
        done = threading.Event()
        self.scripts.append(done)
        try:
            self.script(stream)
        except Silence as silence:
            for rule in self.rules:
                self.judge(rule, False, str(silence))
        finally:
            done.set()

    def settle(self) -> None:
        for done in self.scripts:
            done.wait(self.patience)

    def script(self, stream: Stream) -> None:
        self.welcome(stream)
        self.converse(stream)
        self.finish(stream)

    def converse(self, stream: Stream) -> None:
        raise NotImplementedError

    def hear(self, answer: str) -> None:
        self.judge(
            "ends-with-the-mesh", answer == "over SUCCEEDED", f"`{answer}`", "`over SUCCEEDED`"
        )

    # What scripts are made of.

    def welcome(self, stream: Stream) -> str:
        """Judges nothing; returns what was wrong with the first message."""
        first = stream.hear(self.patience)
        kind = "the end of the stream" if first is None else first.WhichOneof("message")
        problem = ""
        if first is None or kind != "hello":
            problem = f"the first message is {kind}"
        elif first.hello.mesh != self.mesh:
            problem = f"hello.mesh is {first.hello.mesh!r}"
        elif len(first.hello.worker.encode()) > 128:
            problem = "hello.worker has more than 128 bytes"
        else:
            self.max_chunk = first.hello.max_chunk_queries
        if problem:
            raise Refusal(grpc.StatusCode.INVALID_ARGUMENT, problem, "OUT_OF_ORDER")
        stream.say(
            welcome=pb.Welcome(
                dimension=self.spec.dimension,
                ambient_dimension=self.spec.ambient_dimension,
                oracle=self.spec.oracle,
                answer_seconds=self.answer_seconds,
                walls=self.spec.walls,
            )
        )
        return problem

    def finish(self, stream: Stream) -> None:
        """The mesh is over, and so is the stream."""
        stream.say(over=pb.MeshOver(state="MESH_STATE_SUCCEEDED"))

    def near(self, n: int) -> np.ndarray:
        """Points from which the closest one is well determined."""
        on = self.oracle.closest_point(self.rng.normal(size=(n, self.oracle.ambient_dimension)) + 0)
        return on + 0.05 * self.rng.normal(size=on.shape) / np.sqrt(on.shape[1])

    def question(self, points: np.ndarray, tangents: bool = False, sizes: bool = False) -> Any:
        self.leases += 1
        return pb.QueryChunk(
            lease=self.leases,
            kind=pb.QUERY_KIND_CLOSEST_POINT,
            points=to_wire(points),
            want_tangents=tangents,
            want_sizes=sizes,
        )

    def flats(self, n: int, radius: float, **wants: bool) -> Any:
        """Lines through points near the sphere, tilted at random."""
        c = self.near(n)
        normals = c + 0.3 * self.rng.normal(size=c.shape)
        bases = np.linalg.svd(normals[:, None, :])[2][:, 1:, :].transpose(0, 2, 1)
        chunk = self.question(c, **wants)
        chunk.kind = pb.QUERY_KIND_INTERSECT_FLAT
        chunk.bases.CopyFrom(to_wire(bases))
        chunk.radii.CopyFrom(to_wire(np.full(n, radius)))
        return chunk

    def answered(self, stream: Stream, chunk: Any, seconds: float | None = None) -> str:
        """Asks, and says what is wrong with the answer; "" if nothing is. Raises: Silence."""
        stream.say(queries=chunk)
        return self.wrong(chunk, self.reply(stream, seconds))

    def reply(self, stream: Stream, seconds: float | None = None) -> Any:
        """The next message that is no Busy."""
        while True:
            said = stream.hear(seconds or self.patience)
            if said is None or said.WhichOneof("message") != "busy":
                return said

    def wrong(self, chunk: Any, said: Any) -> str:
        if said is None or said.WhichOneof("message") != "answers":
            return f"{'the end of the stream' if said is None else said.WhichOneof('message')} came"
        answer = said.answers
        if answer.lease != chunk.lease:
            return f"answers.lease is {answer.lease} and was {chunk.lease}"
        try:
            return self._wrong_arrays(chunk, answer)
        except ValueError as error:
            return str(error)

    def _wrong_arrays(self, chunk: Any, answer: Any) -> str:
        d, k = self.oracle.ambient_dimension, self.oracle.dimension
        x = from_wire(chunk.points, -1, d)
        n = len(x)
        found = self.oracle.found(x) if hasattr(self.oracle, "found") else np.ones(n, bool)
        if chunk.kind == pb.QUERY_KIND_INTERSECT_FLAT:
            bases, radii = from_wire(chunk.bases, n, d, k), from_wire(chunk.radii, n)
            right, found = self.oracle.intersect_flat(x, bases, radii)
        elif chunk.face:
            right, found = self.oracle.face_point(x, tuple(chunk.face))
        else:
            right = self.oracle.closest_point(x)
        if answer.found and (len(answer.found) != n or set(answer.found) - {0, 1}):
            return f"found has {len(answer.found)} bytes {set(answer.found)} for {n} queries"
        theirs = np.frombuffer(answer.found, "u1").astype(bool) if answer.found else None
        said = from_wire(answer.points, n, d)
        problem = manifolds.wrong_points(right, found, said, theirs)
        if problem or not found.any():
            return problem and f"points: {problem}"
        if chunk.want_tangents:
            bases = from_wire(answer.tangents, n, d, k)
            tangents = self.oracle.tangent_basis(right)
            problem = manifolds.wrong_tangents(tangents, found, bases)
            if problem:
                return f"tangents: {problem}"
        if chunk.want_sizes:
            sizes = self.oracle.local_size(right)
            problem = manifolds.wrong_values(sizes, found, from_wire(answer.sizes, n))
        problem = problem and f"sizes: {problem}"
        return problem or self._wrong_walls(chunk, answer, right, found)

    def _wrong_walls(self, chunk: Any, answer: Any, right: np.ndarray, found: np.ndarray) -> str:
        if not chunk.want_clearances:
            return ""
        face = tuple(chunk.face)
        wanted = {"clearances": self.oracle.clearances(right)}
        if face:
            wanted["conormals"] = self.oracle.conormals(right, face)
        for name, values in wanted.items():
            try:
                said = from_wire(getattr(answer, name), *values.shape)
            except ValueError as error:
                return f"{name}: {error}"
            problem = manifolds.wrong_values(values, found, said)
            if problem:
                return f"{name}: {problem}"
        return ""

    def ask(self, stream: Stream, rule: str, chunk: Any, wanted: str = "a right answer") -> None:
        problem = self.answered(stream, chunk)
        self.judge(rule, not problem, problem, wanted)


class Answers(Serving):
    """A mesh from its beginning to its end."""

    name = "worker"
    rules = (
        "hello-first", "one-row", "many-rows", "points-alone", "two-chunks-open", "newer-server",
        "one-answer-a-lease", "ends-its-half-with-the-mesh", "ends-with-the-mesh",
    )  # fmt: skip

    def script(self, stream: Stream) -> None:
        try:
            self.welcome(stream)
        except Refusal as refusal:
            self.judge("hello-first", False, refusal.words, f"Hello with hello.mesh {self.mesh!r}")
            raise
        self.judge("hello-first", True)
        self.ask(stream, "one-row", self.question(self.near(1), tangents=True))
        self.ask(stream, "many-rows", self.question(self.near(self.rows(1000)), tangents=True))
        self.ask(stream, "points-alone", self.question(self.near(3)))
        self.two_open(stream)
        self.newer(stream)
        stream.say(over=pb.MeshOver(state="MESH_STATE_SUCCEEDED"))
        self.after(stream)

    def rows(self, n: int) -> int:
        return min(n, self.max_chunk or n)

    def two_open(self, stream: Stream) -> None:
        open_chunks = [self.question(self.near(self.rows(50)), tangents=True) for _ in range(2)]
        for chunk in open_chunks:
            stream.say(queries=chunk)
        by_lease = {chunk.lease: chunk for chunk in open_chunks}
        problem = ""
        for _ in open_chunks:
            said = self.reply(stream)
            lease = said.answers.lease if said is not None else 0
            chunk = by_lease.pop(lease, None)
            problem = problem or (
                f"an answer to lease {lease}" if chunk is None else self.wrong(chunk, said)
            )
        self.judge("two-chunks-open", not problem, problem, "an answer to each, in any order")

    def newer(self, stream: Stream) -> None:
        chunk = self.question(self.near(2), tangents=True)
        chunk.MergeFromString(_NEWER)
        stream.say_raw(_NEWER_MESSAGE)
        wanted = "a right answer: unknown fields and messages are skipped"
        self.ask(stream, "newer-server", chunk, wanted)

    def after(self, stream: Stream) -> None:
        """What comes when all is answered: nothing, and then the end of the client's half."""
        extra = ""
        try:
            while (said := self.reply(stream, 5)) is not None:
                extra = f"another {said.WhichOneof('message')} came"
        except Silence as silence:
            self.judge("ends-its-half-with-the-mesh", False, str(silence), "the end of its half")
        self.judge("ends-its-half-with-the-mesh", True)
        self.judge("one-answer-a-lease", not extra, extra, "one answer for each lease")


class Manifold(Serving):
    """The layout of answers in other dimensions, and with a chunk as large as they come."""

    rules = ("one-row", "large-chunk", "ends-with-the-mesh")

    def converse(self, stream: Stream) -> None:
        self.ask(stream, "one-row", self.question(self.near(1), tangents=True))
        row = 8 * self.oracle.ambient_dimension * (1 + self.oracle.dimension)
        n = min(_CHUNK_BYTES // row, self.max_chunk or _CHUNK_BYTES)
        self.ask(stream, "large-chunk", self.question(self.near(n), tangents=True))


def manifold(of: str) -> type[Serving]:
    return type("Manifold", (Manifold,), {"manifold": of, "name": f"worker.{of}"})


class Partly(Serving):
    """Closest points that are not found."""

    name, manifold = "worker.half", "half"
    rules = ("found-and-not", "nothing-found", "all-found", "ends-with-the-mesh")

    def converse(self, stream: Stream) -> None:
        x = self.near(20)
        x[:, 0] = np.abs(x[:, 0]) * np.where(np.arange(20) % 2, 1, -1)
        self.ask(stream, "found-and-not", self.question(x, tangents=True), "found 0, 1, 0, 1, ...")
        left = x * [-1, 1, 1] * np.sign(x[:, :1] + 0)
        self.ask(
            stream, "nothing-found", self.question(left, tangents=True),
            "found 0 for all, and points of the shape [n, d] all the same",
        )  # fmt: skip
        self.ask(
            stream, "all-found", self.question(left * [-1, 1, 1], tangents=True),
            "found empty, or 1 for all",
        )  # fmt: skip


class Walls(Serving):
    """A manifold with boundary: clearances, and points of its faces with their conormals."""

    name, manifold = "worker.lune", "lune"
    rules = (
        "clearances", "first-wall", "second-wall", "corner", "corner-and-none", "face-alone",
        "large-chunk", "ends-with-the-mesh",
    )  # fmt: skip

    def face(self, points: np.ndarray, *face: int, clearances: bool = True) -> Any:
        chunk = self.question(points, tangents=True)
        chunk.face.extend(face)
        chunk.want_clearances = clearances
        return chunk

    def converse(self, stream: Stream) -> None:
        self.ask(
            stream, "clearances", self.face(self.near(30)),
            "the walls' values z and y, [n, 2], and no conormals",
        )  # fmt: skip
        for rule, wall in (("first-wall", 0), ("second-wall", 1)):
            self.ask(
                stream, rule, self.face(self.near(30), wall),
                "points of this wall whatever the other says, and one conormal each, [n, 1, 3]",
            )  # fmt: skip
        two = "points of both walls, and two conormals each, [n, 2, 3], those of wall 0 first"
        self.ask(stream, "corner", self.face(self.near(30), 0, 1), two)
        x = self.near(20)
        x[::3, 0] = 0
        none = "found 0 where x = 0, and arrays of all 20 rows"
        self.ask(stream, "corner-and-none", self.face(x, 0, 1), none)
        alone = self.face(self.near(9), 1, clearances=False)
        self.ask(stream, "face-alone", alone, "points of the wall, and nothing of walls")
        n = min(_CHUNK_BYTES // (8 * (3 * 5 + 2)), self.max_chunk or _CHUNK_BYTES)
        self.ask(stream, "large-chunk", self.face(self.near(n), 0, 1), two)


class OtherWalls(Serving):
    """The worker's manifold is not the mesh's: it has no walls."""

    name, rules = "worker", ("other-walls-are-refused",)

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.spec.walls, self.spec.oracle.conormals = 2, True

    def converse(self, stream: Stream) -> None:
        stream.say(queries=self.question(self.near(3), tangents=True))
        try:
            said = self.reply(stream)
        except Silence:  # it cancelled, as it may
            return
        if said is not None:
            came = f"{said.WhichOneof('message')} came"
            self.judge(self.rules[0], False, came, "no answer: the mesh is left to others")

    def hear(self, answer: str) -> None:
        wanted = "error invalidargument"
        self.judge(self.rules[0], agree(answer, wanted), f"`{answer}`", f"`{wanted}`")


class Flats(Serving):
    """Intersections with flats, and local sizes."""

    name, manifold = "worker.sphere", "sphere"
    rules = (
        "flats-met", "flats-missed", "flats-with-tangents-and-sizes", "sizes-alone",
        "tangents-and-sizes", "ends-with-the-mesh",
    )  # fmt: skip

    def converse(self, stream: Stream) -> None:
        self.ask(stream, "flats-met", self.flats(30, 2.5))
        self.ask(stream, "flats-missed", self.flats(30, 1e-4), "found 0 beyond the radius")
        both = self.flats(30, 0.04, tangents=True, sizes=True)
        self.ask(stream, "flats-with-tangents-and-sizes", both)
        self.ask(stream, "sizes-alone", self.question(self.near(9), sizes=True))
        self.ask(stream, "tangents-and-sizes", self.question(self.near(9), True, True))
