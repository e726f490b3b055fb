"""What a manifold has to answer, and the checks its answers pass before they are sent."""

from __future__ import annotations

import contextlib
import operator
import os
import threading
from collections.abc import Iterator
from typing import Any, Protocol, runtime_checkable

import numpy as np

from ._rows import unmasked
from .errors import InvalidArgument, NotConverged, OracleError, add_words

__all__ = ["Oracle"]

_MOST_ABOUT_ITSELF = 300  # characters, which servers take


@runtime_checkable
class Oracle(Protocol):
    """A compact smooth k-submanifold M of R^d: closed, with k < d, or bounded by `walls`, with k <= d.

    Every method takes and returns whole batches as numpy arrays of float64; those it is given are
    read-only. The answer to a query must not depend on the rest of its batch: batches are cut
    differently from run to run.

    Besides what is declared here an oracle may have:
      intersect_flat(centers (n, d), bases (n, d, k), radii (n,)) -> (points (n, d), found (n,)):
        the point of M nearest to each center in the flat {c + v : basis^T v = 0} within the radius,
        or found = False where there is none. Without it the server asks for closest points only.
      tangent_basis(points (n, d)) -> (n, d, k): orthonormal columns that span the tangent space at
        points of M. Without it the server finds tangent spaces from closest points.
      local_size(points (n, d)) -> (n,): how large things are at points of M: the local feature size
        there, or any positive lengths of yours. With size_rate or max_deviation the mesh goes by
        it; without it the server estimates. A point's size must depend on the point alone.
      walls: how many walls bound M, which has a boundary then: M = {x in M^ : g_i(x) >= 0} for the
        walls g_i, i < walls, and the methods above are those of M^, whose dimension may be d. It takes
        tangent_basis, and
      face_point(points (n, d), face) -> (n, d): nearest points of M^ where the walls of `face`, a
        tuple of their numbers, ascending, are zero. May raise NotConverged.
      clearances(points (n, d)) -> (n, walls): the g_i; their signs count.
      conormals(points (n, d), face) -> (n, len(face), d): at points of a face, the outward unit normal
        of each of its walls within the tangent space. stellate.oracles.Clipped has all of these.
      labels: (2^walls,) whole numbers from -1 to 127, for walls where M is not all that is positive:
        unions, differences, several materials. Entry s is the label of the points where wall i is
        positive if bit i of s is set, and else negative. M is where the label is not 0; its regions,
        one for each label, are meshed together, and mesh.labels says which simplex is in which. -1
        stands where no point has such signs. At most 16 walls may have labels.
      closures: sets of walls with labels, of numbers, for walls that depend on each other: each of a
        set, of three or more, is zero wherever all others of it are, as f - g, g - h and f - h are.
        A face is then asked for with all walls that are zero on it, although some follow from others.
      region_names: a str for each of the labels 1, 2, ..., for people and for the groups of files; ""
        where there is none. At most 128 bytes each.
      coordinate_names: a str for each of the d coordinates; the mesh has them, and Mesh.to_pandas.
      jacobian(points (n, d)) -> (n, m, d): of the equations that M is given by, if it is. Only
        stellate.check asks, to find where they lose rank.
      coordinates(points (n, d)) -> (n, m): those that people know points of M by, where M lies in R^d
        for the mesh's sake only, as a PeriodicCell does: the verdict, warnings, the report's sharpest
        angle and refusals then name places in these.
      bounding_box: (lower (d,), upper (d,)), where to look for M, or
      seeds: (m, d), points near M, one at least on each component. One of the two is needed.
      in_units(scale (d,)) -> oracle: of {x / scale : x in M}, for stellate.mesh(..., scale=).
      coordinate_scale: (d,), set by oracles.in_units: the mesh's points, and the places in what a server
        says of it, are delivered multiplied by it.
      thread_safe: True lets several workers call it at the same time.
      about: a str, one sentence that it says of itself, for people, such as what it was fitted with:
        the verdict ends with its first 300 characters, as the oracle's own words.
    """

    dimension: int  # k
    ambient_dimension: int  # d

    def closest_point(self, points: np.ndarray) -> np.ndarray:
        """(n, d) -> (n, d): a point of M nearest to each. May raise NotConverged."""
        ...


class CheckedOracle:
    """An oracle as the server sees it: shapes, types and finiteness are checked with clear words.

    Calls come one at a time unless the oracle says `thread_safe = True`.
    """

    def __init__(self, oracle: Any) -> None:
        self._oracle = oracle
        self.dimension = _whole_number(oracle, "dimension")
        self.ambient_dimension = _whole_number(oracle, "ambient_dimension")
        if not callable(getattr(oracle, "closest_point", None)):
            raise InvalidArgument(f"{type(oracle).__name__} has no method closest_point(points)")
        self.has_intersect_flat = callable(getattr(oracle, "intersect_flat", None))
        self.has_tangent_basis = callable(getattr(oracle, "tangent_basis", None))
        self.has_local_size = callable(getattr(oracle, "local_size", None))
        self.has_jacobian = callable(getattr(oracle, "jacobian", None))
        self.walls = self._count_walls(oracle)
        self.labels = _labels(getattr(oracle, "labels", None), self.walls)
        self.closures = _closures(getattr(oracle, "closures", ()))
        self.region_names = _names(getattr(oracle, "region_names", ()))
        self.coordinate_names = _names_of_coordinates(oracle, self.ambient_dimension)
        self.coordinate_scale = tuple(map(float, getattr(oracle, "coordinate_scale", ())))
        self.about = _sentence(getattr(oracle, "about", ""))
        self.bounding_box = _box(getattr(oracle, "bounding_box", None))
        seeds = getattr(oracle, "seeds", None)
        self.seeds = None if seeds is None else points_of(seeds, self.ambient_dimension)
        shared = bool(getattr(oracle, "thread_safe", False))
        self._one_at_a_time = _Turns()
        if shared:
            self._one_at_a_time = contextlib.nullcontext()

    _one_at_a_time: contextlib.AbstractContextManager[Any]

    @contextlib.contextmanager
    def _turn(self, method: str) -> Iterator[None]:
        """Around a call of the oracle's; numpy does not say whose the arrays are that it protects."""
        with self._one_at_a_time:
            try:
                yield
            except ValueError as error:
                if "read-only" in str(error):
                    add_words(
                        error, f"the arrays that {method} is given are not its own: copy them"
                    )
                raise

    def closest_points(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, d) -> the closest points (n, d), and where they were found (n,).

        No method of the oracle is asked for no rows, here and below.
        """
        if not len(points):
            return _none(points)
        with self._turn("closest_point"):
            try:
                answer = self._oracle.closest_point(points)
                found = np.ones(len(points), dtype=bool)
            except NotConverged as error:
                answer, found = error.points, error.converged
        found = _flags("closest_point", found, len(points))
        return _numbers("closest_point", answer, points.shape, found), found

    def _count_walls(self, oracle: Any) -> int:
        if getattr(oracle, "walls", None) is None:
            return 0
        walls = _whole_number(oracle, "walls")
        lacking = [
            name
            for name in ("tangent_basis", "face_point", "clearances", "conormals")
            if walls and not callable(getattr(oracle, name, None))
        ]
        if lacking:
            raise InvalidArgument(
                f"{type(oracle).__name__} has walls, and lacks {' and '.join(lacking)}"
            )
        return walls

    def face_points(
        self, points: np.ndarray, face: tuple[int, ...]
    ) -> tuple[np.ndarray, np.ndarray]:
        """As closest_points, of a face of a manifold with boundary."""
        if not len(points):
            return _none(points)
        with self._turn("face_point"):
            try:
                answer = self._oracle.face_point(points, face)
                found = np.ones(len(points), dtype=bool)
            except NotConverged as error:
                answer, found = error.points, error.converged
        found = _flags("face_point", found, len(points))
        return _numbers("face_point", answer, points.shape, found), found

    def clearances(self, points: np.ndarray, found: np.ndarray) -> np.ndarray:
        """(n, d) -> (n, walls); the rows that were not found hold any."""
        return self._at_found("clearances", points, found, np.zeros(self.walls))

    def conormals(self, points: np.ndarray, found: np.ndarray, face: tuple[int, ...]) -> np.ndarray:
        """(n, d) -> (n, len(face), d); the rows that were not found hold any."""
        anywhere = np.zeros((len(face), self.ambient_dimension))
        return self._at_found("conormals", points, found, anywhere, face)

    def intersections(
        self, centers: np.ndarray, bases: np.ndarray, radii: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The points (n, d) where M meets the flats, and where it does (n,)."""
        if not len(centers):
            return _none(centers)
        with self._turn("intersect_flat"):
            try:
                answer = self._oracle.intersect_flat(centers, bases, radii)
            except NotConverged as error:
                answer = error.points, error.converged
        if not isinstance(answer, (tuple, list)) or len(answer) != 2:
            raise OracleError(
                f"intersect_flat returned {_describe(answer)}; it has to return the pair "
                "(points (n, d), found (n,))",
                "ORACLE_SHAPE",
            )
        found = _flags("intersect_flat", answer[1], len(centers))
        return _numbers("intersect_flat", answer[0], centers.shape, found), found

    def tangents(self, points: np.ndarray, found: np.ndarray) -> np.ndarray:
        """(n, d) -> (n, d, k) orthonormal bases; the rows that were not found hold any basis."""
        anywhere = np.eye(self.ambient_dimension, self.dimension)
        return self._at_found("tangent_basis", points, found, anywhere)

    def sizes(self, points: np.ndarray, found: np.ndarray) -> np.ndarray:
        """(n, d) -> (n,) lengths; the rows that were not found hold any."""
        return self._at_found("local_size", points, found, np.ones(()))

    def jacobians(self, points: np.ndarray) -> np.ndarray:
        """(n, d) -> (n, m, d), for any m."""
        with self._one_at_a_time:
            answer = np.asarray(self._oracle.jacobian(points))
        rows = answer.shape[1] if answer.ndim == 3 else 1
        shape = (len(points), rows, self.ambient_dimension)
        return _numbers("jacobian", answer, shape, np.ones(len(points), dtype=bool))

    def _at_found(
        self, method: str, points: np.ndarray, found: np.ndarray, anywhere: np.ndarray, *more: Any
    ) -> np.ndarray:
        """What the method says of the points that were found, and `anywhere` for the others."""
        everywhere = bool(found.all())
        on_manifold = points.view() if everywhere else np.ascontiguousarray(points[found])
        on_manifold.flags.writeable = False
        count = len(on_manifold)
        values = np.empty((0, *anywhere.shape))
        if count:
            with self._turn(method):
                answer = getattr(self._oracle, method)(on_manifold, *more)
            all_rows = np.ones(count, dtype=bool)
            values = _numbers(method, answer, (count, *anywhere.shape), all_rows)
        if everywhere:
            return values
        spread = np.broadcast_to(anywhere, (len(points), *anywhere.shape)).copy()
        spread[found] = values
        return spread


class _Turns:
    """A lock, which is a new one where what holds it is copied, as to another process."""

    def __init__(self) -> None:
        self._lock = threading.Lock()

    def __enter__(self) -> None:
        self._lock.acquire()

    def __exit__(self, *unused: object) -> None:
        self._lock.release()

    def __reduce__(self) -> tuple[type[_Turns], tuple[()]]:
        return _Turns, ()


def _none(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.empty(points.shape), np.empty(0, dtype=bool)


def _describe(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} and type {value.dtype}"
    return f"a {type(value).__name__}"


def _numbers(method: str, answer: Any, shape: tuple[int, ...], found: np.ndarray) -> np.ndarray:
    """The answer as float64, or an OracleError that says what is wrong with it."""
    try:
        array = np.asarray(unmasked(answer))
    except ValueError:  # ragged lists
        array = np.asarray(None)
    if array.dtype.kind not in "fiu":
        raise OracleError(
            f"{method} returned {_describe(answer)}; it has to return real numbers "
            f"of shape {shape}",
            "ORACLE_SHAPE",
        )
    if array.shape != shape:
        raise OracleError(
            f"{method} returned an array of shape {array.shape} for a batch of {shape[0]}; "
            f"the shape has to be {shape}",
            "ORACLE_SHAPE",
        )
    array = np.ascontiguousarray(array, dtype=np.float64)
    bad = found & ~np.isfinite(array).all(axis=tuple(range(1, array.ndim)))
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        raise OracleError(
            f"{method} returned {array[row].tolist()} for query {row} of a batch of {shape[0]} "
            f"({np.count_nonzero(bad)} answers are not finite); where there is no answer, say so: "
            "found = False from intersect_flat, or raise stellate.NotConverged from closest_point",
            "ORACLE_NOT_FINITE",
        )
    if not found.all():
        array = np.where(found.reshape((-1,) + (1,) * (array.ndim - 1)), array, 0.0)
    return array


def _flags(method: str, found: Any, count: int) -> np.ndarray:
    flags = np.asarray(found)
    if flags.shape != (count,) or flags.dtype.kind not in "biu":
        raise OracleError(
            f"{method} returned {_describe(flags)} for found; it has to be {count} booleans",
            "ORACLE_SHAPE",
        )
    return flags.astype(bool)


def _labels(labels: Any, walls: int) -> bytes:
    """Of the sign vectors of the walls, a byte each; none without labels."""
    if labels is None:
        return b""
    given = np.asarray(labels)
    if given.shape != (1 << min(walls, 16),):
        raise InvalidArgument(
            f"labels has the shape {given.shape}, and {walls} walls have {1 << walls} vectors of signs: "
            "give one for each, in an array of one axis"
        )
    if given.dtype.kind not in "iub" or given.min() < -1 or given.max() > 127:
        raise InvalidArgument(
            "labels have to be whole numbers from 0, outside of M, to 127, or -1 where no point is"
        )
    return given.astype(np.int8).tobytes()


def _names_of_coordinates(oracle: Any, d: int) -> tuple[str, ...]:
    names = getattr(oracle, "coordinate_names", ())
    fits = isinstance(names, (tuple, list)) and all(isinstance(name, str) for name in names)
    if not fits or len(names) not in (0, d):
        raise InvalidArgument(
            f"coordinate_names have to be {d} str, one for each coordinate: {names!r}"
        )
    return tuple(names)


def _names(names: Any) -> tuple[str, ...]:
    names = () if names is None else names
    if isinstance(names, str) or not all(isinstance(name, str) for name in names):
        raise InvalidArgument(
            "region_names have to be a sequence of str, one for each label from 1 on"
        )
    return tuple(names)


def _closures(closures: Any) -> tuple[tuple[int, ...], ...]:
    try:
        sets = tuple(tuple(operator.index(wall) for wall in closure) for closure in closures or ())
    except TypeError:
        sets = ((-1,),)
    if any(not 0 <= wall < 64 for walls in sets for wall in walls):
        raise InvalidArgument("closures have to be sets of walls, each a sequence of their numbers")
    return sets


def _whole_number(oracle: Any, name: str) -> int:
    if isinstance(oracle, type):
        raise InvalidArgument(
            f"{oracle.__name__} is a class: give an object of it, such as {oracle.__name__}()"
        )
    try:
        value = getattr(oracle, name)
    except AttributeError:
        raise InvalidArgument(
            f"{type(oracle).__name__} has no attribute {name}: an oracle needs dimension (k), "
            f"ambient_dimension (d) and closest_point{_instead(oracle)}"
        ) from None
    try:
        as_float = float(value)
    except (TypeError, ValueError):
        as_float = float("nan")
    if not as_float.is_integer():
        raise InvalidArgument(f"{name} has to be a whole number, and is {value!r}")
    return int(value)


def _instead(given: Any) -> str:
    """What makes an oracle of something that is none."""
    if callable(given):
        return (
            "; of an equation f(x) = 0 stellate.ImplicitManifold(f, ambient_dimension=, dimension=, "
            "bounding_box=) makes one, of a parametrization stellate.oracles.Parametrized"
        )
    if isinstance(given, np.ndarray):
        return (
            "; of points stellate.oracles.PointCloud(points, k) makes one, of a mask, an image or a "
            "volume of voxels stellate.oracles.SignedDistance.of_volume(array, spacing=, level=, smooth=)"
        )
    if isinstance(given, (str, os.PathLike)):
        return (
            "; of a file of triangles stellate.oracles.TriangleMesh(file) makes one, and "
            "stellate.manifolds has a few ready"
        )
    return ""


def _sentence(about: Any) -> str:
    """In one line, without what terminals obey."""
    if not isinstance(about, str):
        return ""
    printable = "".join(c if c.isprintable() else " " for c in about)
    return " ".join(printable.split())[:_MOST_ABOUT_ITSELF]


def _box(box: Any) -> tuple[np.ndarray, np.ndarray] | None:
    if box is None:
        return None
    try:
        lower, upper = (np.asarray(corner, dtype=np.float64) for corner in box)
    except (TypeError, ValueError):
        raise InvalidArgument(
            f"bounding_box has to be a pair of points (lower (d,), upper (d,)), and is {box!r}"
        ) from None
    return lower, upper


def points_of(seeds: Any, d: int) -> np.ndarray:
    """(m, d), as float64. Raises: InvalidArgument."""
    try:
        array = np.asarray(unmasked(seeds), dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidArgument("seeds have to be an array of points (m, d)") from None
    if array.ndim != 2 or array.shape[1] != d or not len(array):
        one = f"; a single one is [{seeds!r}]" if array.shape == (d,) else ""
        raise InvalidArgument(
            f"seeds have to be points as rows, of the shape (m, {d}), and have the shape "
            f"{array.shape}{one}"
        )
    return array
