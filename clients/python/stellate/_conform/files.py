"""tests/conformance of the source tree, which the package carries."""

from __future__ import annotations

import importlib.resources
import json
from collections.abc import Iterator
from typing import Any

from .._generated import stellate_pb2 as pb


def carried(path: str) -> bytes:
    at = importlib.resources.files("stellate._generated").joinpath("conformance")
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
