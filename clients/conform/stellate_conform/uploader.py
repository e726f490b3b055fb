"""The rules of those who send points to be reconstructed from."""

from __future__ import annotations

import hashlib
import pathlib
from collections.abc import Iterator
from typing import Any

import grpc
import numpy as np
from stellate._generated import mesh_pb2, stellate_pb2
from stellate._wire.arrays import from_wire

from .scenario import Refusal, Scenario, agree

_CHUNK_BYTES = 1 << 20  # "about 1 MB at most", by the proto
_POINTS = 45_000  # more than a chunk holds
_RECORDED = 12_345  # a row within a chunk, whatever its size is


class Uploading(Scenario):
    """The server's side of one upload, which may come in several streams."""

    name = "points"
    rules: tuple[str, ...] = (
        "declared", "chunks-follow-each-other", "points-unchanged", "digest", "ends-with-an-end",
    )  # fmt: skip
    points = _POINTS
    max_message_bytes = 4 << 20

    def __init__(self, folder: pathlib.Path, *arguments: Any) -> None:
        super().__init__(*arguments)
        rng = np.random.default_rng(11)
        self.given = rng.normal(size=(self.points, 3))
        self.given /= np.linalg.norm(self.given, axis=1)[:, None]
        self.path = folder / "points.xyz"
        # Digits enough for the same doubles.
        self.path.write_text("".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in self.given.tolist()))
        self.recorded, self.streams, self.specs, self.ended = 0, 0, 0, False

    @property
    def line(self) -> str:
        return f"reconstruct {self.path} 2 3"

    def upload(self, chunks: Iterator[stellate_pb2.PointsChunk]) -> stellate_pb2.ReconstructReply:
        self.streams += 1
        self._open_with(next(chunks, stellate_pb2.PointsChunk()))
        for chunk in chunks:
            kind = chunk.WhichOneof("message")
            if kind == "points":
                self._take(chunk.points)
                self.after_points()
            elif kind == "end":
                self._finish(chunk.end)
            else:
                self._refuse(
                    "chunks-follow-each-other", f"{kind} within a stream", "points, or end"
                )
        return stellate_pb2.ReconstructReply(mesh=self.get(), rows=self.recorded)

    def after_points(self) -> None:
        """Raises: Refusal, where the stream is to break off here."""

    def after_end(self) -> None:
        """As after_points."""

    def get(self) -> mesh_pb2.Mesh:
        mesh = super().get()
        if self.ended:  # the kit meshes nothing
            mesh.state = mesh_pb2.MESH_STATE_CANCELLED
            mesh.end_time.GetCurrentTime()
            mesh.report.termination = mesh_pb2.TERMINATION_CANCELLED
        return mesh

    def watch(self, request: Any) -> Iterator[stellate_pb2.WatchMeshResponse]:
        self.over.wait(self.patience)
        yield stellate_pb2.WatchMeshResponse(final=self.get())

    def hear(self, answer: str) -> None:
        came, wanted = f"`{answer}`, and no PointsEnd", "PointsEnd after the last row"
        self.judge("ends-with-an-end", self.ended, came, wanted)

    def _open_with(self, first: stellate_pb2.PointsChunk) -> None:
        kind = first.WhichOneof("message")
        if kind == "spec":
            self.specs += 1
            sizes = (first.spec.dimension, first.spec.ambient_dimension, first.spec.points)
            wanted = (2, 3, self.points)
            good = sizes == wanted and not first.spec.tangents and self.specs == 1
            came = f"k, d and n are {sizes}, in specification {self.specs} of the mesh"
            if not self.judge("declared", good, came, f"{wanted}, once, without tangents"):
                raise Refusal(grpc.StatusCode.INVALID_ARGUMENT, came)
        elif kind != "mesh" or first.mesh != self.mesh:
            came = f"{kind}: {first.mesh!r}"
            self._refuse("declared", came, f"a specification first, or {self.mesh}")

    def _take(self, points: stellate_pb2.Points) -> None:
        came = f"row {points.first_row}"
        if points.first_row != self.recorded:
            self._refuse("chunks-follow-each-other", came, f"row {self.recorded}")
        try:
            rows = from_wire(points.points, -1, 3)
        except ValueError as error:
            self._refuse("chunks-follow-each-other", str(error), "points of the shape [m, 3]")
        if len(points.points.data) > _CHUNK_BYTES or len(rows) == 0:
            came = f"{len(rows)} points of {len(points.points.data)} bytes"
            self._refuse("chunks-follow-each-other", came, f"1 to {_CHUNK_BYTES} bytes of points")
        end = self.recorded + len(rows)
        if rows.tobytes() != self.given[self.recorded : end].tobytes():
            self._refuse("points-unchanged", f"other numbers from {came} on", "those of the file")
        self.recorded = end

    def _finish(self, end: stellate_pb2.PointsEnd) -> None:
        rows = f"the end after {self.recorded} of {self.points} rows"
        if self.recorded != self.points:
            self._refuse("ends-with-an-end", rows, "all of them before")
        wanted = hashlib.sha256(self.given.astype("<f8").tobytes()).hexdigest()
        came = end.points_sha256.hex()
        if came != wanted:
            self._refuse("digest", f"points_sha256 {came}", f"{wanted}: of [n, d] as on the wire")
        self.after_end()
        self.ended = True
        for rule in self.rules:
            self.judge(rule, True)
        self.over.set()

    def _refuse(self, rule: str, came: str, wanted: str) -> None:
        self.judge(rule, False, came, wanted)
        raise Refusal(grpc.StatusCode.INVALID_ARGUMENT, f"{came}; wanted: {wanted}")


class Broken(Uploading):
    """A server that is lost in the middle, with a part of what was sent recorded; and after the end."""

    name = "points.server-stops"
    rules = ("goes-on-from-what-is-recorded", "sends-the-end-again")

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.breaks = 0

    def after_points(self) -> None:
        if self.breaks == 0:
            self._break(_RECORDED)
        self.judge(self.rules[0], True)  # its first row was the one that is recorded

    def after_end(self) -> None:
        if self.breaks == 1:
            self._break(self.points)

    def _break(self, recorded: int) -> None:
        self.breaks += 1
        self.recorded = recorded
        raise Refusal(grpc.StatusCode.UNAVAILABLE, "the server is stopping", "SHUTTING_DOWN")

    def _refuse(self, rule: str, came: str, wanted: str) -> None:
        open_rule = self.rules[0] if self.breaks < 2 else self.rules[1]
        super()._refuse(open_rule, came, wanted)

    def hear(self, answer: str) -> None:
        came = f"`{answer}` after {self.streams} streams"
        for rule in self.rules:  # that are open still
            self.judge(rule, False, came, "another stream, which names the mesh and goes on")


class WrongRow(Uploading):
    """A row that the server refuses: its words reach the user, and nobody comes back."""

    name = "points.wrong-row"
    rules = ("says-why", "stays-away")
    words = "points row 17: coordinate 1 is nan but must be finite"

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.refused = 0

    def after_points(self) -> None:
        self.refused += 1
        self.recorded = 0
        code = grpc.StatusCode.INVALID_ARGUMENT
        raise Refusal(code, self.words, "INVALID_ARGUMENT", field="points.points")

    def hear(self, answer: str) -> None:
        start = "error invalidargument INVALID_ARGUMENT"
        good = agree(answer, start) and self.words in answer
        self.judge("says-why", good, f"`{answer}`", f"`{start} {self.words}`")
        came = f"the points came {self.refused} times"
        self.judge("stays-away", self.refused == 1, came, "once: they are wrong")


class Ragged(Uploading):
    """A file with a line that is too short is refused before the server hears of it."""

    name, rules = "points.ragged-file", ("refused", "nothing-is-sent")
    points = 20

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        lines = self.path.read_text().splitlines()
        lines[7] = lines[7].rsplit(maxsplit=1)[0]
        self.path = self.path.with_name("ragged.xyz")
        self.path.write_text("\n".join(lines) + "\n")

    def hear(self, answer: str) -> None:
        self.judge("refused", agree(answer, "error invalidargument"), f"`{answer}`", "an error")
        came = f"{self.streams} streams"
        self.judge("nothing-is-sent", self.streams == 0, came, "none: 59 numbers are no points")


def point_scenarios(folder: pathlib.Path, *arguments: Any) -> Iterator[Scenario]:
    for kind in (Uploading, Broken, WrongRow, Ragged):
        yield kind(folder, *arguments)
