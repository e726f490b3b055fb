"""One thing that a client is told to do, and the rules that it is then held to."""

from __future__ import annotations

import secrets
import threading
from collections.abc import Iterator
from typing import Any, Callable

import grpc
from stellate._generated import mesh_pb2, stellate_pb2
from stellate._generated import status_details_pb2 as details_pb
from stellate._shared import table

from .driver import Speechless
from .results import FAIL, PASS, UNTRIED, Result, Results


class Refusal(Exception):
    """How a call is to end."""

    def __init__(
        self, code: grpc.StatusCode, words: str, reason: str = "", field: str = "", **metadata: str
    ) -> None:
        super().__init__(words)
        self.code, self.words, self.details = code, words, b""
        status = details_pb.Status(code=code.value[0], message=words)
        if reason:
            info = details_pb.ErrorInfo(reason=reason, domain="stellate.v1", metadata=metadata)
            _pack(status, "ErrorInfo", info)
        if field:
            bad = details_pb.BadRequest()
            bad.field_violations.add(field=field, description=words)
            _pack(status, "BadRequest", bad)
        if reason or field:
            self.details = status.SerializeToString()


def _pack(status: details_pb.Status, kind: str, message: Any) -> None:
    status.details.add(
        type_url=f"type.googleapis.com/google.rpc.{kind}", value=message.SerializeToString()
    )


class Scenario:
    """What the server does while a client obeys `line`. Of each rule there is one verdict.

    The server asks from threads of its own, the kit judges the client's answer when it comes.
    """

    name = ""
    rules: tuple[str, ...] = ()
    max_message_bytes = 0  # that the server says it takes; 0: it says nothing

    def __init__(self, results: Results, patience: float) -> None:
        self.mesh = f"meshes/{secrets.token_hex(16)}"
        self.patience = patience
        self.spec = mesh_pb2.MeshSpec(dimension=2, ambient_dimension=3, epsilon=0.1)
        self.over = threading.Event()
        self._results, self._open, self._lock = results, list(self.rules), threading.Lock()

    @property
    def line(self) -> str:
        raise NotImplementedError

    def hear(self, answer: str) -> None:
        """The client's answer to the line, canonical()."""

    def settle(self) -> None:
        """Waits for what is still being judged elsewhere."""

    def create(self, request: Any, metadata: dict[str, str]) -> mesh_pb2.Mesh:
        raise Refusal(grpc.StatusCode.FAILED_PRECONDITION, "the kit did not ask for a mesh")

    def get(self) -> mesh_pb2.Mesh:
        return mesh_pb2.Mesh(name=self.mesh, spec=self.spec, state=mesh_pb2.MESH_STATE_RUNNING)

    def watch(self, request: Any) -> Iterator[stellate_pb2.WatchMeshResponse]:
        raise Refusal(grpc.StatusCode.FAILED_PRECONDITION, "the kit did not ask for a watcher")

    def download(self, request: Any) -> Iterator[stellate_pb2.DownloadMeshResponse]:
        raise Refusal(grpc.StatusCode.NOT_FOUND, "the kit has no mesh", "MESH_NOT_FOUND")

    def upload(self, chunks: Iterator[Any]) -> stellate_pb2.ReconstructReply:
        raise Refusal(grpc.StatusCode.FAILED_PRECONDITION, "the kit did not ask for points")

    def serve(self, stream: Any) -> None:
        raise Refusal(grpc.StatusCode.FAILED_PRECONDITION, "the kit did not ask for a worker")

    def judge(self, rule: str, good: bool, came: str = "", wanted: str = "") -> bool:
        """The first verdict on a rule counts. Returns `good`."""
        self._settle(rule, PASS if good else FAIL, came, wanted)
        return good

    def _settle(self, rule: str, verdict: str, came: str, wanted: str = "") -> None:
        with self._lock:
            if rule not in self._open:
                return
            self._open.remove(rule)
        said = (came, wanted) if verdict != PASS else ("", "")
        self._results.add(Result(f"{self.name}.{rule}", verdict, *said))

    def end(self, verdict: str, why: str) -> None:
        """Of all rules that are open still."""
        self.over.set()
        for rule in list(self._open):
            self._settle(rule, verdict, why)


def canonical(answer: str) -> str:
    """With the name of a class of errors as all write it: languages have their own."""
    words = answer.split()
    if words[:1] == ["error"] and len(words) > 1:
        words[1] = words[1].lower().replace("_", "")
        short = {"other": "stellateerror", "save": "saveerror", "raised": "oracleerror"}
        words[1] = short.get(words[1], words[1])
    return " ".join(words)


def agree(said: str, wanted: str) -> bool:
    """Whether an answer, canonical(), begins with the words that are wanted.

    "-" stands for what a client does not tell. A class of errors may be told by whose fault they are.
    """
    ours, theirs = wanted.split(), said.split()
    if len(theirs) < len(ours):
        return False
    fault = table("errors.toml")["classes"].values()
    for i, (want, word) in enumerate(zip(ours, theirs)):
        is_class = i == 1 and ours[0] == "error" and word in fault
        if word not in (want, "-") and not (is_class and word == _fault_of(want)):
            return False
    return True


def _fault_of(kind: str) -> str:
    classes = table("errors.toml")["classes"].items()
    return {name.lower(): fault for name, fault in classes}[kind]


def run(scenario: Scenario, tell: Callable[[str, float], str]) -> None:
    """Raises: Speechless, with every rule judged."""
    try:
        answer = tell(scenario.line, scenario.patience)
    except Speechless as why:
        scenario.end(FAIL, str(why))
        raise
    if answer == "unsupported":
        scenario.end(UNTRIED, f"the client does not do `{scenario.line}`")
        return
    scenario.settle()
    scenario.hear(canonical(answer))
    scenario.end(FAIL, f"it never came so far; the client said `{answer}`")
