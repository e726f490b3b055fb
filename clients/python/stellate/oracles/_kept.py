"""Parts of a manifold: what lies in the oracle's box, or the components that seeds lie on."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from .._point_sets import as_points, tree_of
from .._rows import Array, Flags, apply, norms, product, transposed
from ..errors import InvalidArgument
from ..oracle import CheckedOracle
from ._common import all_or_raise, where_of
from ._walls import Clipped

Keep = Literal["box", "seeds"]

_FIRST_STEP = 0.05  # of the walk, in shares of the box, and its longest if there is one
_LEAST_STEP = 1e-6  # where M bends within less, it has a crease
_ROUNDING = 1e-12  # the same in shares of the largest coordinate, where there is no box
_GROWTH = 1.5  # of a step from one point to the next
# The sine that a tangent space may turn by within a step, by k: more dimensions take more points.
_TURN = (0.0, 0.3, 0.3, 0.5, 0.5, 0.5)
# Of a chord, the share that may lie across the mean of the tangent spaces at its ends: an arc's turn^2 / 4,
# and 1 across from one sheet to another.
_ACROSS = 0.08
_APART = 0.5  # of the points of the net, in steps
_REACH = 1.25  # how far about itself a point of the net tells what is kept, in steps
_NEAREST = 8  # points of the net that are compared with
_MOST = 200_000  # points of the net, from which a component counts as endless


def kept(oracle: Any, keep: Keep, seeds: Any = None) -> Any:
    """The oracle of a part of a manifold; `stellate.mesh(oracle, epsilon, keep=...)` is of it.

    Args:
      oracle: with tangent bases.
      keep: "box": what lies in the oracle's bounding_box, whose sides are walls: where M leaves the
        box it is cut, and components outside of it are nobody's concern. Clipped(oracle, box=) is
        the same for any box.
        "seeds": the components that seeds lie on, whole, and no other; needs scipy. They are
        followed once, from the seeds on, with steps by how M bends. A component that is nearer to them
        than a few hundredths of the radius of curvature there is kept with them.
      seeds: (s, d) points near what is kept, instead of the oracle's.

    Raises: InvalidArgument, also where a component of the seeds has no end or a crease.
    """
    if keep == "box":
        box = CheckedOracle(oracle).bounding_box
        if box is None:
            raise InvalidArgument(
                f"keep='box' keeps what lies in the oracle's bounding_box, and {type(oracle).__name__} "
                "has none: give it one, or keep='seeds'"
            )
        return Clipped(oracle, box=box, seeds=seeds)
    if keep == "seeds":
        return SeedComponents(oracle, seeds)
    raise InvalidArgument(
        "keep has to be 'box', for what lies in the bounding box, or 'seeds', for the components "
        f"that seeds lie on, and is {keep!r}",
        details={"fields": {"keep": "must be 'box' or 'seeds'"}},
    )


class SeedComponents:
    """The components of a manifold that seeds lie on: no other point of it is an answer."""

    def __init__(self, oracle: Any, seeds: Any = None) -> None:
        self._base = base = CheckedOracle(oracle)
        name = type(oracle).__name__
        if base.walls:
            raise InvalidArgument(
                f"keep='seeds' is for manifolds without boundary, and {name} has walls: keep the "
                "components first, and clip these: Clipped(oracles.kept(oracle, 'seeds'), walls)"
            )
        if not base.has_tangent_basis:
            raise InvalidArgument(f"to follow {name} from its seeds takes its tangent_basis")
        if seeds is None:
            seeds = base.seeds
        if seeds is None:
            raise InvalidArgument(
                "keep='seeds' keeps the components that seeds lie on, and there are none: give "
                "seeds, or keep='box'"
            )
        self.seeds = as_points(seeds, "seeds")
        self.dimension, self.ambient_dimension = base.dimension, base.ambient_dimension
        self.thread_safe = bool(getattr(oracle, "thread_safe", False))
        self.about, self.coordinate_scale = base.about, base.coordinate_scale
        if callable(getattr(oracle, "coordinates", None)):
            self.coordinates = oracle.coordinates
        if base.bounding_box is not None:
            self.bounding_box = base.bounding_box
        if base.has_intersect_flat:
            self.intersect_flat = self._intersect_flat
        for method in ("tangent_basis", "local_size", "jacobian"):
            if getattr(base, f"has_{method}"):
                setattr(self, method, getattr(oracle, method))
        self._net = _Net(base, self.seeds)

    def closest_point(self, points: Array) -> Array:
        """(n, d) -> (n, d). Raises: NotConverged where the nearest point is on another component."""
        nearest, found = self._base.closest_points(np.ascontiguousarray(points))
        return all_or_raise(nearest, self._net.has(nearest, found))

    def _intersect_flat(self, centers: Array, bases: Array, radii: Array) -> tuple[Array, Flags]:
        points, found = self._base.intersections(centers, bases, radii)
        return points, self._net.has(points, found)


class _Net:
    """Points all over the components that seeds lie on, with tangent spaces, and steps within which
    these turn by little."""

    def __init__(self, oracle: CheckedOracle, seeds: Array) -> None:
        self._oracle, self._k = oracle, oracle.dimension
        self._lower, self._upper = where_of(oracle)
        self._scale = float(norms(self._upper - self._lower))
        self._longest = np.inf if oracle.bounding_box is None else _FIRST_STEP * self._scale
        self._turn = _TURN[min(self._k, len(_TURN) - 1)]
        feet, found = oracle.closest_points(seeds)
        if not found.any():
            raise InvalidArgument("keep='seeds': no seed has a closest point on the manifold")
        feet = np.ascontiguousarray(feet[found])
        self._least = _LEAST_STEP * self._scale
        if oracle.bounding_box is None:  # and no length to measure with
            self._least = _ROUNDING * float(np.abs(feet).max())
        self._points = np.empty((0, oracle.ambient_dimension))
        self._bases = np.empty((0, oracle.ambient_dimension, self._k))
        self._steps = np.empty(0)
        front = feet, self._tangents(feet), np.full(len(feet), _FIRST_STEP * self._scale)
        while len(front[0]):
            front = self._next(self._add(*front))
        self._tree = tree_of(self._points)

    def has(self, points: Array, found: Flags) -> Flags:
        """Which of the points of M (n, d), where found, lie on the components."""
        rows = np.flatnonzero(found)
        result = np.zeros(len(found), dtype=bool)
        y = np.ascontiguousarray(points[rows])
        count = min(_NEAREST, len(self._points))
        distances, ids = self._tree.query(y, k=count)
        distances, ids = distances.reshape(-1, count), ids.reshape(-1, count)
        if not rows.size:
            return result
        bases = self._tangents(y)
        for n in range(count):
            near = ids[:, n]
            close = distances[:, n] <= _REACH * self._steps[near]
            turn, across = _compared(self._points[near], self._bases[near], y, bases)
            limit = 2 * _REACH * self._turn
            result[rows] |= close & (turn <= limit) & (across <= _ACROSS * distances[:, n])
        return result

    def _tangents(self, points: Array) -> Array:
        return self._oracle.tangents(points, np.ones(len(points), dtype=bool))

    def _add(self, points: Array, bases: Array, steps: Array) -> Any:
        """Those that lie apart from each other and from the net become its points; their numbers."""
        first = len(self._points)
        if first:
            distances, ids = tree_of(self._points).query(points)
            apart = distances > _APART * self._steps[ids]
            points, bases, steps = points[apart], bases[apart], steps[apart]
        taken = np.ones(len(points), dtype=bool)
        if len(points):
            tree = tree_of(points)
            for i, near in enumerate(tree.query_ball_point(points, _APART * steps)):
                if taken[i]:
                    taken[[j for j in near if j > i]] = False
        self._points = np.concatenate([self._points, points[taken]])
        self._bases = np.concatenate([self._bases, bases[taken]])
        self._steps = np.concatenate([self._steps, steps[taken]])
        self._insist_on_an_end(points[taken])
        return np.arange(first, len(self._points))

    def _next(self, rows: Any) -> tuple[Array, Array, Array]:
        """What a step along each tangent vector leads to, from points of the net whose steps are
        shortened until M bends by little within them."""
        ahead = [(self._points[:0], self._bases[:0], self._steps[:0])]
        while rows.size:
            here, bases = self._points[rows], self._bases[rows]
            sides = np.concatenate([bases, -bases], axis=2).transpose(0, 2, 1)
            aims = here[:, None, :] + self._steps[rows, None, None] * sides
            count, d = sides.shape[1:]
            there, found = self._oracle.closest_points(np.ascontiguousarray(aims.reshape(-1, d)))
            tangents = self._oracle.tangents(np.ascontiguousarray(there), found)
            origins, around = np.repeat(here, count, axis=0), np.repeat(bases, count, axis=0)
            turn, across = _compared(origins, around, there, tangents)
            length, step = norms(there - origins), np.repeat(self._steps[rows], count)
            good = found & (turn <= self._turn) & (across <= _ACROSS / 2 * length)
            good &= np.abs(length - step) <= step / 4  # and not as far as it could get
            done = good.reshape(-1, count).all(axis=1)
            each = np.repeat(done, count)
            longer = np.minimum(_GROWTH * step[each], self._longest)
            ahead.append((there[each], tangents[each], longer))
            rows = rows[~done]
            self._steps[rows] /= 2
            self._insist_on_smoothness(rows)
        points, bases, steps = (np.concatenate(parts) for parts in zip(*ahead))
        return points, bases, steps

    def _insist_on_smoothness(self, rows: Any) -> None:
        short = rows[self._steps[rows] < self._least]
        if short.size:
            place = _name(self._points[short[0]])
            raise InvalidArgument(
                f"keep='seeds' cannot follow the manifold beyond {place}: it ends there, has a crease "
                "or is singular; stellate.check looks closer"
            )

    def _insist_on_an_end(self, points: Array) -> None:
        beyond = norms(np.maximum(0, np.maximum(self._lower - points, points - self._upper)))
        far = self._oracle.bounding_box is not None and (beyond > self._scale).any()
        if not far and len(self._points) <= _MOST:
            return
        where = (
            f"leaves the bounding box near {_name(points[np.argmax(beyond)])} by more than its diagonal"
            if far
            else f"is not at its end after {len(self._points):,} steps"
        )
        raise InvalidArgument(
            f"keep='seeds' keeps whole components, and that of the seeds {where}: is it unbounded? "
            "keep='box' keeps what lies in the bounding box, and cuts the manifold at its sides"
        )


def _compared(p: Array, p_bases: Array, y: Array, y_bases: Array) -> tuple[Array, Array]:
    """Of two points of M with their tangent spaces, a row each: a bound of the sine between the spaces,
    and how much of the chord lies across the mean of both: of an arc turn^2 / 4, by its symmetry."""
    turned = y_bases - product(p_bases, product(transposed(p_bases), y_bases))
    chord = y - p
    off = chord - (_within(p_bases, chord) + _within(y_bases, chord)) / 2
    return np.sqrt((turned * turned).sum(axis=(1, 2))), norms(off)


def _within(bases: Array, vectors: Array) -> Array:
    return apply(bases, apply(transposed(bases), vectors))


def _name(point: Array) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in point) + ")"
