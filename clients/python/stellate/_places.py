"""Places in what a server says of a mesh, in the coordinates that people know them by."""

from __future__ import annotations

import dataclasses
import re
from typing import Any, Callable

import numpy as np

from ._findings import Finding
from ._mesh import Mesh
from .errors import StellateError
from .report import Report

_NUMBER = r"-?(?:\d+\.?\d*(?:e[+-]?\d+)?)"
# As servers write them, and as oracles do, which show them whole: "[0.5, 1.0]".
_POINT = re.compile(rf"\(({_NUMBER}(?:, {_NUMBER})+)(, \.\.\.)?\)|\[({_NUMBER}(?:, {_NUMBER})+)\]")
_ROUNDED = 1e-3  # of the largest coordinate: servers write four digits
_MOST_SHOWN = 6  # coordinates, as servers write them


class Places:
    """Of an oracle that has `coordinates`: see stellate.Oracle. Of others nothing changes."""

    def __init__(self, oracle: Any, *, asked: bool = False) -> None:
        """`asked`: in what the oracle says, who is asked in x / scale where there is a scale; else in what a
        server says, in x."""
        given = getattr(oracle, "coordinates", None)
        self._coordinates: Callable[[Any], Any] | None = given if callable(given) else None
        scale = np.array(getattr(oracle, "coordinate_scale", ()), dtype=float)
        if asked and len(scale):
            plain = self._coordinates
            self._coordinates = lambda y: y * scale if plain is None else plain(y * scale)

    @property
    def known(self) -> bool:
        """Whether it has."""
        return self._coordinates is not None

    def in_mesh(self, mesh: Any) -> Any:
        """The mesh with its report's places in those coordinates."""
        if self._coordinates is None or mesh.report is None:
            return mesh
        points = mesh.points
        report: Report = mesh.report.reworded(lambda text: self.in_words(text, points))
        sharpest = report.certificate.sharpest
        if sharpest is not None and len(sharpest.point) == points.shape[1]:
            at = tuple(self._plain(np.array([sharpest.point]))[0].tolist())
            sharpest = dataclasses.replace(sharpest, point=at)
            certificate = dataclasses.replace(report.certificate, sharpest=sharpest)
            report = dataclasses.replace(report, certificate=certificate)
        return dataclasses.replace(mesh, report=report)

    def in_error(self, error: StellateError, d: int) -> StellateError:
        """The error, of a mesh in R^d, that says its places in those coordinates."""
        if self._coordinates is not None and len(error.args) == 1:
            points = error.mesh.points if isinstance(error.mesh, Mesh) else np.empty((0, d))
            error.args = (self.in_words(str(error), points),)
        return error

    def in_finding(self, finding: Finding, d: int) -> Finding:
        """What a doctor found of an oracle in R^d, with its places in those coordinates."""
        if self._coordinates is None:
            return finding
        message = self.in_words(finding.message, np.empty((0, d)))
        place = finding.place
        if place is not None and len(place) == d:
            place = self._plain(np.asarray(place, dtype=np.float64)[None])[0]
        return dataclasses.replace(finding, message=message, place=place)

    def in_words(self, text: str, points: np.ndarray) -> str:
        """A text in which each point of R^d is that of the vertex there, or else as it was rounded.

        Of a point whose last coordinates are not written the vertices have to tell it; else it stays.

        Args:
          points: (n, d), the vertices.
        """
        d = points.shape[1]
        if self._coordinates is None:
            return text

        def plain(match: re.Match[str]) -> str:
            said = np.array([float(number) for number in (match[1] or match[3]).split(", ")])
            if match[3]:
                return _listed(self._plain(said[None])[0]) if len(said) == d else match[0]
            if len(said) != min(d, _MOST_SHOWN) or bool(match[2]) != (d > _MOST_SHOWN):
                return match[0]
            there = self._plain(points[self._at(said, points)])
            if not len(there) and not match[2]:
                there = self._plain(said[None])
            if not len(there) or (match[2] and np.ptp(there, axis=0).max() > _ROUNDED):
                return match[0]
            return "(" + ", ".join(f"{number:.4g}" for number in there[0]) + ")"

        return _POINT.sub(plain, text)

    def _at(self, said: np.ndarray, points: np.ndarray) -> np.ndarray:
        """The vertices that are where a text says, the nearest first."""
        off = np.abs(points[:, : len(said)] - said).max(axis=1)
        near = np.flatnonzero(off <= _ROUNDED * np.abs(said).max())
        return near[np.argsort(off[near], kind="stable")]

    def _plain(self, points: np.ndarray) -> np.ndarray:
        assert self._coordinates is not None
        if not len(points):  # which no oracle is asked for
            return points
        found = np.asarray(self._coordinates(points), dtype=np.float64)
        return np.where(np.abs(found) < 1e-12 * np.abs(found).max(initial=1.0), 0.0, found)


def _listed(point: np.ndarray) -> str:
    return "[" + ", ".join(f"{number:.6g}" for number in point) + "]"
