"""The rules of those who declare meshes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import grpc
import numpy as np
from stellate._generated import mesh_pb2, stellate_pb2
from stellate._wire.arrays import from_wire

from .files import entries
from .scenario import Refusal, Scenario, agree

_TOKEN = "secret-of-the-kit"  # noqa: S105


class Creating(Scenario):
    """Looks at what is declared."""

    name, what = "creator", ""

    @property
    def line(self) -> str:
        return f"create conform {self.what}".rstrip()

    def create(self, request: Any, metadata: dict[str, str]) -> mesh_pb2.Mesh:
        self.look(request.spec, metadata)
        return self.get()

    def look(self, spec: mesh_pb2.MeshSpec, metadata: dict[str, str]) -> None:
        raise NotImplementedError

    def watch(self, request: Any) -> Iterator[stellate_pb2.WatchMeshResponse]:
        """Clients that cannot declare a mesh without meshing it are told that it is over."""
        mesh = self.get()
        mesh.state = mesh_pb2.MESH_STATE_CANCELLED
        mesh.report.termination = mesh_pb2.TERMINATION_CANCELLED
        yield stellate_pb2.WatchMeshResponse(final=mesh)
        self.over.set()

    def serve(self, stream: Any) -> None:
        self.over.wait(self.patience)

    def hear(self, answer: str) -> None:
        wanted = f"created {self.mesh}"
        self.judge("declared", agree(answer, wanted), f"`{answer}`", f"`{wanted}`")


class Defaults(Creating):
    rules = (
        "dimensions", "epsilon", "box", "capabilities", "label", "defaults-are-absent", "declared",
    )  # fmt: skip

    def look(self, spec: mesh_pb2.MeshSpec, metadata: dict[str, str]) -> None:
        sizes = (spec.dimension, spec.ambient_dimension)
        self.judge("dimensions", sizes == (2, 3), f"{sizes}", "2 and 3")
        self.judge("epsilon", spec.epsilon == 0.5, f"{spec.epsilon}", "0.5")
        self.judge("label", spec.label == "conform", repr(spec.label), "'conform'")
        can = spec.oracle
        good = can.tangent_basis and not can.intersect_flat
        self.judge("capabilities", good, str(can).replace("\n", " "), "a torus with tangent bases")
        self.judge("box", *_box(spec))
        given = [field.name for field, _ in spec.criteria.ListFields()]
        given += [field.name for field, _ in spec.limits.ListFields()]
        known = {"dimension", "ambient_dimension", "epsilon", "label", "oracle", "bounding_box"}
        known |= {"criteria", "limits", "random_seed"}
        given += [field.name for field, _ in spec.ListFields() if field.name not in known]
        if spec.random_seed > 1:
            given.append("random_seed")
        wanted = "what was not asked for is left to the server"
        self.judge("defaults-are-absent", not given, ", ".join(given), wanted)


def _box(spec: mesh_pb2.MeshSpec) -> tuple[bool, str, str]:
    wanted = "a box with lower and upper of the shape [3], around the torus"
    try:
        lower, upper = (from_wire(a, 3) for a in (spec.bounding_box.lower, spec.bounding_box.upper))
    except ValueError as error:
        return False, str(error), wanted
    corner = np.array([1.4, 1.4, 0.4])
    good = bool((lower <= -corner).all() and (upper >= corner).all())
    return good, f"{lower} to {upper}", wanted


class Seeds(Creating):
    name, what, rules = "creator.seeds", "seeds", ("in-place-of-a-box", "declared")

    def look(self, spec: mesh_pb2.MeshSpec, metadata: dict[str, str]) -> None:
        wanted, rule = "seeds of the shape [m, 3], and no box", self.rules[0]
        try:
            seeds = from_wire(spec.seeds, -1, 3)
            box = spec.HasField("bounding_box")
            self.judge(rule, len(seeds) > 0 and not box, f"{len(seeds)} seeds", wanted)
        except ValueError as error:
            self.judge(rule, False, str(error), wanted)


class Walls(Creating):
    name, what, rules = "creator.walls", "walls", ("their-number", "capabilities", "declared")

    def look(self, spec: mesh_pb2.MeshSpec, metadata: dict[str, str]) -> None:
        self.judge("their-number", spec.walls == 2, f"walls is {spec.walls}", "2")
        good = spec.oracle.tangent_basis and spec.oracle.conormals
        came = str(spec.oracle).replace("\n", " ")
        self.judge("capabilities", good, came, "tangent bases and conormals, which walls need")


class Token(Creating):
    name, rules = "creator", ("token-in-metadata", "declared")
    what = f"token={_TOKEN}"

    def look(self, spec: mesh_pb2.MeshSpec, metadata: dict[str, str]) -> None:
        said, wanted = metadata.get("authorization", ""), f"Bearer {_TOKEN}"
        good = said == wanted
        self.judge("token-in-metadata", good, f"authorization: {said!r}", f"{wanted!r}")


class Repeated(Creating):
    """The reply is lost. A client may say so, or repeat its request so that there is one mesh."""

    rules = ("repeated-by-its-id", "repeated-unchanged")

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._lost: Any = None

    def create(self, request: Any, metadata: dict[str, str]) -> mesh_pb2.Mesh:
        if self._lost is None:
            self._lost = request
            raise Refusal(grpc.StatusCode.UNAVAILABLE, "the kit lost the reply")
        before, now = self._lost, request
        good = now.mesh_id == before.mesh_id and re.fullmatch("[0-9a-f]{32}", now.mesh_id)
        wanted = "the same 32 hexadecimal digits both times, or no second call"
        came = f"mesh_id {before.mesh_id!r}, then {now.mesh_id!r}"
        self.judge("repeated-by-its-id", bool(good), came, wanted)
        same = now.spec == before.spec
        self.judge("repeated-unchanged", same, "another spec", "the same spec both times")
        return self.get()

    def hear(self, answer: str) -> None:
        good = agree(answer, "error unavailable")
        for rule in self.rules:  # that are open still: nothing was repeated
            self.judge(rule, good, f"`{answer}`", "`error unavailable`, or a second call")


_TRANSIENT = (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED)


class Status(Creating):
    """A refusal, and the error that it is shown as; or the mesh, where a client tries again."""

    def __init__(self, entry: Any, *arguments: Any) -> None:
        code = next(code for code in grpc.StatusCode if code.value[0] == entry["code"])
        self.name = "creator"
        self.rules = (f"status {code.name} {entry['reason']}".rstrip() + _about(entry),)
        super().__init__(*arguments)
        self.entry, self._again = entry, False
        self.refusal = Refusal(code, entry["message"])
        self.refusal.details = bytes.fromhex(entry["details"])

    def create(self, request: Any, metadata: dict[str, str]) -> mesh_pb2.Mesh:
        if self._again:
            return self.get()
        self._again = self.refusal.code in _TRANSIENT
        raise self.refusal

    def hear(self, answer: str) -> None:
        wanted = f"error {self.entry['class'].lower()} {self.entry['reason']}".strip()
        made = self._again and agree(answer, f"created {self.mesh}")
        self.judge(self.rules[0], made or agree(answer, wanted), f"`{answer}`", f"`{wanted}`")


def _about(entry: Any) -> str:
    about = entry.get("about", "")
    return f": {about}" if about else ""


class Field(Creating):
    """A field that is refused: its name and the server's words reach the user."""

    rules = ("refused-field-is-shown",)
    words = "epsilon is -1 but must be a length above 0"

    def create(self, request: Any, metadata: dict[str, str]) -> mesh_pb2.Mesh:
        code = grpc.StatusCode.INVALID_ARGUMENT
        raise Refusal(code, self.words, "INVALID_ARGUMENT", field="spec.epsilon")

    def hear(self, answer: str) -> None:
        start = "error invalidargument INVALID_ARGUMENT"
        good = agree(answer, start) and self.words in answer
        wanted = f"`{start} {self.words}`"
        self.judge("refused-field-is-shown", good, f"`{answer}`", wanted)


def creator_scenarios(*arguments: Any) -> Iterator[Scenario]:
    for kind in (Defaults, Seeds, Walls, Field, Repeated):
        yield kind(*arguments)
    for entry in entries("errors.json")["statuses"]:
        yield Status(entry, *arguments)
    yield Token(*arguments)
