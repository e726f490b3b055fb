"""tests/conformance of the source tree; its wheel carries a copy."""

from __future__ import annotations

import importlib.resources
import json
import pathlib
from collections.abc import Iterator
from typing import Any

from stellate._generated import stellate_pb2 as pb


def carried(path: str) -> bytes:
    at = importlib.resources.files("stellate_conform").joinpath("conformance")
    if not at.is_dir():
        at = pathlib.Path(__file__).resolve().parents[3] / "tests" / "conformance"
    for part in path.split("/"):
        at = at.joinpath(part)
    return at.read_bytes()


def entries(name: str) -> Any:
    return json.loads(carried(name))


def recorded(path: str) -> Iterator[pb.WatchMeshResponse]:
    """The messages of a .watch file."""
    raw, at = carried(path), 0
    while at < len(raw):
        end = at + 4 + int.from_bytes(raw[at : at + 4], "little")
        yield pb.WatchMeshResponse.FromString(raw[at + 4 : end])
        at = end
