"""Points, and tangent spaces, that a manifold is to be reconstructed from: checked, and as a specification."""

from __future__ import annotations

import numbers
import os
from typing import Any, Literal, Union

import numpy as np

from ._generated import mesh_pb2 as pb
from ._rows import unmasked
from .errors import InvalidArgument

Noise = Union[float, Literal["auto"], None]
Weights = Literal["auto", "only"]

_WEIGHTINGS = {"auto": pb.WEIGHTING_AUTO, "only": pb.WEIGHTING_ONLY}
_ORTHONORMAL = 1e-9  # what differs by more is made so; the server allows 1e-6
_DEPENDENT = 1e-6  # of the longest column: what is left of one that has nothing of its own


DIMENSION_IS_MISSING = (
    "dimension is missing: of the manifold that the points lie on, 1 for a curve, 2 for a surface: "
    "dimension=2"
)


class CheckedPoints:
    """What stellate.reconstruct was given, as the server takes it.

    Attributes:
      points: (n, d) float64, finite.
      tangents: (n, d, k) float64, orthonormal columns; None: the server estimates them.
      spec: the specification.
    """

    points: np.ndarray
    tangents: np.ndarray | None
    spec: pb.Reconstruction

    def __init__(
        self,
        points: Any,
        dimension: int | None,
        tangents: Any,
        noise: Noise,
        reach: float | None,
        drop: float,
        closed: bool,
        limits: dict[str, Any],
        label: str | None,
        weights: Weights = "auto",
        steiner: bool = False,
    ) -> None:
        """Raises: InvalidArgument, naming the row where it is one."""
        if dimension is None:
            raise TypeError(DIMENSION_IS_MISSING)
        if isinstance(dimension, bool) or not isinstance(dimension, numbers.Integral):
            raise InvalidArgument(f"dimension has to be a whole number, and is {dimension!r}")
        self.points = _array(points, "points", 2, "(n, d), a row for each point")
        n, d = self.points.shape
        self.tangents = None
        if tangents is not None:
            wanted = f"({n}, {d}, {dimension}): of each point d x k, its columns tangent vectors"
            given = _array(tangents, "tangents", 3, wanted)
            if given.shape != (n, d, dimension):
                raise InvalidArgument(f"tangents have the shape {given.shape}, and need {wanted}")
            self.tangents = _orthonormal(given)
        self.spec = pb.Reconstruction(open=not closed)
        _set(self.spec, "dimension", int(dimension))
        _set(self.spec, "ambient_dimension", d)
        _set(self.spec, "points", n)
        self.spec.tangents = self.tangents is not None
        if isinstance(noise, str) and noise != "auto":
            raise InvalidArgument(f"noise has to be a length or 'auto', and is {noise!r}")
        if noise is not None and noise != "auto":
            _set(self.spec, "noise", noise)
        if reach is not None:
            _set(self.spec, "declared_reach", reach)
        _set(self.spec, "drop", drop)
        if weights not in _WEIGHTINGS:
            raise InvalidArgument(f"weights has to be 'auto' or 'only', and is {weights!r}")
        self.spec.weights = _WEIGHTINGS[weights]
        _set(self.spec, "steiner", steiner)
        for name, value in limits.items():
            if value is not None:
                _set(self.spec.limits, name, value)
        if label is not None:
            _set(self.spec, "label", label)

    def divide(self, units: np.ndarray) -> None:
        """To the coordinates x / units, (d,). Raises: InvalidArgument."""
        with np.errstate(over="ignore"):
            divided = self.points / units
        if not np.isfinite(divided).all():
            raise InvalidArgument(f"points / scale are not finite: the scale is {units.tolist()}")
        self.points = divided
        if self.tangents is not None:
            self.tangents = _orthonormal(self.tangents / units[:, None])


def _set(message: Any, name: str, value: Any) -> None:
    try:
        setattr(message, name, value)
    except (TypeError, ValueError) as error:
        name = {"declared_reach": "reach"}.get(name, name)
        raise InvalidArgument(f"{name} is {value!r}: {error}") from None


def _array(values: Any, name: str, axes: int, shape: str) -> np.ndarray:
    if isinstance(values, (str, os.PathLike)):
        raise InvalidArgument(
            f"{name} have to be numbers, {shape}, and are the name of a file, {os.fspath(values)!r}: read it "
            "first, as by np.loadtxt; in the shell `stellate reconstruct FILE -k 2 -o mesh.vtu` reads .ply, "
            ".npy, .csv, .xyz and .txt"
        )
    try:
        array = np.asarray(unmasked(values))
        if array.dtype.kind not in "fiub":
            array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidArgument(
            f"{name} have to be numbers, {shape}{_odd_row(values, axes)} ({error})"
        ) from None
    if array.ndim != axes:
        raise InvalidArgument(f"{name} have {array.ndim} axes, and need {axes}: {shape}")
    array = np.ascontiguousarray(array, dtype=np.float64)
    bad = ~np.isfinite(array).all(axis=tuple(range(1, axes)))
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        raise InvalidArgument(
            f"row {row} of {name} is {array[row].tolist()}: numbers have to be finite; leave such "
            "rows out"
        )
    return array


def _odd_row(values: Any, axes: int) -> str:
    """Which row of a list is unlike the first, where that is known."""
    if axes != 2 or not isinstance(values, (list, tuple)):
        return ""
    try:
        sizes = [len(row) for row in values]
    except TypeError:
        return ""
    odd = next((row for row, size in enumerate(sizes) if size != sizes[0]), None)
    if odd is None:
        return ""
    return f"; row {odd} has {sizes[odd]} and row 0 has {sizes[0]}"


def _orthonormal(bases: np.ndarray) -> np.ndarray:
    """The bases, those that are not orthonormal replaced by one of the same space."""
    k = bases.shape[2]
    off = np.abs(np.einsum("nia,nib->nab", bases, bases) - np.eye(k)).reshape(len(bases), -1)
    wrong = np.flatnonzero(off.max(axis=1, initial=0) > _ORTHONORMAL)
    if not len(wrong):
        return bases
    factors = np.linalg.qr(bases[wrong])
    own = np.abs(np.diagonal(factors[1], axis1=1, axis2=2))
    longest = np.linalg.norm(bases[wrong], axis=1).max(axis=1, keepdims=True)
    dependent = ~(own > _DEPENDENT * longest).all(axis=1)
    if dependent.any():
        row = int(wrong[np.flatnonzero(dependent)[0]])
        raise InvalidArgument(
            f"row {row} of tangents does not span {k} directions: its columns are {bases[row].T.tolist()}"
        )
    mended = bases.copy()
    mended[wrong] = factors[0]
    return mended
