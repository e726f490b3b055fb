"""Names of the protocol's enum values."""

from __future__ import annotations

from typing import Any

from .._generated import mesh_pb2 as pb

UNKNOWN = "UNKNOWN"  # a value that the server left out, or that is newer than this client


def _name(enum: Any, prefix: str, number: int) -> str:
    value = enum.DESCRIPTOR.values_by_number.get(number)
    return UNKNOWN if value is None or number == 0 else value.name.removeprefix(prefix)


def phase(number: int) -> str:
    return _name(pb.Phase, "PHASE_", number)


def termination(number: int) -> str:
    return _name(pb.Termination, "TERMINATION_", number)


def level(number: int) -> str:
    return _name(pb.CertificateLevel, "CERTIFICATE_LEVEL_", number)


def place(number: int) -> str:
    value = pb.Place.DESCRIPTOR.values_by_number.get(number)
    return UNKNOWN if value is None else value.name.removeprefix("PLACE_")


def state(number: int) -> str:
    return _name(pb.MeshState, "MESH_STATE_", number)


def state_of(name: str) -> str:
    """The state that a MeshOver names."""
    value = pb.MeshState.DESCRIPTOR.values_by_name.get(name)
    return UNKNOWN if value is None else state(value.number)
