"""From an oracle and keyword arguments to the protocol's MeshSpec."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any, get_args

import numpy as np
from google.protobuf.descriptor import FieldDescriptor

from .._generated import mesh_pb2 as pb
from ..errors import InvalidArgument
from ..options import Audit, MeshOptions, SpecOptions, types
from ..oracle import CheckedOracle, points_of
from .arrays import to_wire

_WHOLE = {
    FieldDescriptor.CPPTYPE_INT32,
    FieldDescriptor.CPPTYPE_INT64,
    FieldDescriptor.CPPTYPE_UINT32,
    FieldDescriptor.CPPTYPE_UINT64,
}
_CRITERIA = {field.name for field in pb.Criteria.DESCRIPTOR.fields}
# Keywords, and the fields of MeshSpec that they set.
_SPEC = {"reach": "declared_reach"}
_SPEC.update(
    (f.name, f.name) for f in pb.MeshSpec.DESCRIPTOR.fields if f.name in types(SpecOptions)
)
_SERVING = set(types(MeshOptions)) - set(types(SpecOptions))  # keywords of stellate.mesh alone
# Arguments with names of their own, which somebody may have meant.
_NAMED = {"epsilon", "server", "on_progress", "credentials", "checkpoint", "save", "keep", "scale"}
_AUDITS = {name: pb.Audit.Value(f"AUDIT_{name.upper()}") for name in get_args(Audit)}
# The server asks for larger dihedral angles, and tries more candidates, where the bound is above
# its default.
_GOOD_SLIVER_BOUND = 0.3
_LIMITS = {field.name for field in pb.MeshLimits.DESCRIPTOR.fields}


def mesh_spec(oracle: CheckedOracle, epsilon: float, options: Mapping[str, Any]) -> pb.MeshSpec:
    """The specification of a mesh. Ranges are the server's to check; here only types are.

    Raises: TypeError for an unknown keyword, InvalidArgument for a value of the wrong type.
    """
    spec = pb.MeshSpec()
    _set(spec, "dimension", oracle.dimension)
    _set(spec, "ambient_dimension", oracle.ambient_dimension)
    _set(spec, "epsilon", epsilon)
    spec.oracle.intersect_flat = oracle.has_intersect_flat
    spec.oracle.tangent_basis = oracle.has_tangent_basis
    spec.oracle.local_size = oracle.has_local_size
    spec.oracle.conormals = oracle.walls > 0
    spec.oracle.about = oracle.about
    _set(spec, "walls", oracle.walls)
    spec.labels = oracle.labels
    for closure in oracle.closures:
        spec.closures.add(walls=closure)
    spec.region_names.extend(oracle.region_names)
    spec.scale.extend(oracle.coordinate_scale)
    if oracle.bounding_box is not None:
        lower, upper = oracle.bounding_box
        spec.bounding_box.lower.CopyFrom(to_wire(lower))
        spec.bounding_box.upper.CopyFrom(to_wire(upper))
    if oracle.seeds is not None:
        spec.seeds.CopyFrom(to_wire(oracle.seeds))
    for name, value in options.items():
        if value is None:
            continue
        if name in _CRITERIA:
            _set(spec.criteria, name, value)
        elif name in _LIMITS:
            _set(spec.limits, name, value)
        elif name == "audit":
            _set(spec, name, _audit(value))
        elif name == "shape":
            _set(spec.criteria, "sliver_bound", _sliver_bound(value, oracle, options))
        elif name == "seeds":
            spec.seeds.CopyFrom(to_wire(points_of(value, oracle.ambient_dimension)))
        elif name in _SPEC:
            _set(spec, _SPEC[name], value)
        elif name in _SERVING:
            raise TypeError(f"{name!r} is for who serves the mesh, not for declaring it")
        elif name == "keep":
            raise TypeError("'keep' is about the oracle: give oracles.kept(oracle, keep, seeds)")
        elif name == "scale":
            raise TypeError("'scale' is about the oracle: give oracles.in_units(oracle, scale)")
        else:
            raise TypeError(_unknown(name))
    return spec


def _set(message: Any, name: str, value: Any) -> None:
    if isinstance(value, np.generic):
        value = value.item()
    field = message.DESCRIPTOR.fields_by_name[name]
    if isinstance(value, float) and value.is_integer() and field.cpp_type in _WHOLE:
        value = int(value)  # 1e6
    try:
        setattr(message, name, value)
    except (TypeError, ValueError) as error:
        raise InvalidArgument(
            f"{name} cannot be {value!r}: {error}", details={"fields": {name: str(error)}}
        ) from None


def _audit(value: Any) -> int:
    if value not in _AUDITS:
        raise InvalidArgument(
            f"audit is {value!r} but must be 'standard' or 'thorough'",
            details={"fields": {"audit": "must be 'standard' or 'thorough'"}},
        )
    return _AUDITS[value]


def _sliver_bound(shape: Any, oracle: CheckedOracle, options: Mapping[str, Any]) -> float:
    wrong = ""
    if shape != "good":
        wrong = f"is {shape!r} but must be 'good'"
    elif oracle.dimension != 3:
        wrong = f"'good' is for k = 3, and the manifold has k = {oracle.dimension}"
    elif oracle.walls > 0:
        wrong = "'good' is for closed manifolds, and this one has a boundary"
    elif options.get("sliver_bound") is not None:
        wrong = "'good' says what sliver_bound is: give one of them"
    if wrong:
        raise InvalidArgument(f"shape {wrong}", details={"fields": {"shape": wrong}})
    return _GOOD_SLIVER_BOUND


def _unknown(name: str) -> str:
    known = sorted(types(MeshOptions))
    parts = [one for one in known if name in one.split("_")]  # "seed" of random_seed
    near = list(dict.fromkeys([*difflib.get_close_matches(name, [*known, *_NAMED], 1), *parts]))
    hint = (
        f"; did you mean {' or '.join(map(repr, near))}?"
        if near
        else f"; known: {', '.join(known)}"
    )
    return f"unknown keyword {name!r}{hint}"
