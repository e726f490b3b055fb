"""Arrays of numbers between numpy and the wire, without a copy on the way in."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from .._generated import geometry_pb2 as pb


def to_wire(array: np.ndarray) -> pb.Array:
    """Float64 numbers of any shape as a protocol Array."""
    message = pb.Array()
    fill(message, array)
    return message


def fill(message: pb.Array, array: np.ndarray) -> None:
    """As to_wire, into an Array that is empty: without a copy of the message."""
    array = np.ascontiguousarray(array, dtype="<f8")
    message.shape.extend(array.shape)
    message.data = array.tobytes()


def from_wire(array: pb.Array, *shape: int) -> np.ndarray:
    """A read-only view of the bytes; `shape` is what is expected, -1 standing for any extent.

    An Array that is not set at all stands for one without elements.
    """
    return _view(array.shape, array.data, "<f8", shape)


def indices_from_wire(array: pb.IndexArray, *shape: int) -> np.ndarray:
    """As from_wire, for uint32 indices."""
    return _view(array.shape, array.data, "<u4", shape)


def places_from_wire(message: Any, points: int, d: int) -> tuple[np.ndarray, np.ndarray | None]:
    """The codes of a Places, and the smoothed positions, if they are others."""
    codes = np.frombuffer(message.codes, np.uint8)
    if len(codes) != points:
        raise ValueError(f"places of {len(codes)} points where {points} came")
    smoothed = from_wire(message.smoothed, points, d) if message.HasField("smoothed") else None
    return codes, smoothed


def _view(found: Iterable[int], data: bytes, dtype: str, expected: tuple[int, ...]) -> np.ndarray:
    extents = tuple(found)
    if not extents and not data:
        extents = tuple(0 if extent < 0 else extent for extent in expected)
        if 0 not in extents:
            raise ValueError(f"an array of shape {expected} is missing")
    agrees = len(extents) == len(expected) and all(
        want in (-1, got) for want, got in zip(expected, extents)
    )
    if not agrees:
        raise ValueError(f"an array of shape {extents} where {expected} was expected")
    values = np.frombuffer(data, dtype=dtype)
    if values.size != int(np.prod(extents, dtype=np.int64)):
        raise ValueError(f"{len(data)} bytes do not hold an array of shape {extents}")
    return values.reshape(extents)
