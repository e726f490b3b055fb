"""Reconstructor: stellate.reconstruct as those who know scikit-learn expect it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._locate import Located
from ._mesh import FinishedMesh
from ._points import Noise, Weights
from ._reconstruct import reconstruct
from .client import Client
from .errors import FailedPrecondition, InvalidArgument
from .server import Server

__all__ = ["Located", "Reconstructor"]

_PARAMETERS = ("dimension", "noise", "reach", "drop", "closed", "weights", "steiner", "server")


class Reconstructor:
    """A mesh of the points that it is fitted to, by the conventions of scikit-learn's estimators.

        surface = stellate.learning.Reconstructor(dimension=2).fit(X)
        if surface.mesh_.certified:
            values = surface.interpolate(y, other_points)

    Args are those of stellate.reconstruct. It goes into sklearn.base.clone and searches of parameters;
    scikit-learn itself is not needed.

    After `fit` it has `mesh_`, a FinishedMesh; row i of its `points` is row i of X, and those that
    `steiner` added come last; `places_`, (n,) str, what became of each row of X; and `n_features_in_`,
    which is d.
    """

    mesh_: FinishedMesh
    places_: np.ndarray
    n_features_in_: int

    def __init__(
        self,
        dimension: int = 2,
        *,
        noise: Noise = "auto",
        reach: float | None = None,
        drop: float = 0.001,
        closed: bool = True,
        weights: Weights = "auto",
        steiner: bool = False,
        server: str | Server | Client | None = None,
    ) -> None:
        self.dimension, self.noise, self.reach = dimension, noise, reach
        self.drop, self.closed, self.weights = drop, closed, weights
        self.steiner, self.server = steiner, server

    def fit(self, X: Any, y: object = None) -> Reconstructor:  # noqa: N803
        """Makes the mesh of the rows of X, (n, d); y is not looked at.

        It need not be certified: see `mesh_.report`. Raises: as stellate.reconstruct.
        """
        mesh = reconstruct(X, **self.get_params())
        if mesh.places is None:
            raise FailedPrecondition("the server says of no point what became of it")
        self.mesh_, self.places_ = mesh, mesh.places[: len(X)]
        self.n_features_in_ = mesh.ambient_dimension
        return self

    def locate(self, X: Any) -> Located:  # noqa: N803
        """The nearest points of the mesh: see Mesh.locate. Raises: FailedPrecondition before fit."""
        return self._mesh().locate(X)

    def interpolate(self, values: Any, X: Any) -> np.ndarray:  # noqa: N803
        """Values at the rows of X, by those at the mesh's points.

        Args:
          values: (n,) or (n, m) numbers, a row for each row of X that was fitted. Vertices that were
            added get the harmonic values between those around.
          X: (q, d)

        Returns: (q,) or (q, m): linear on each simplex, at the nearest point of the mesh.
        """
        mesh, at = self._mesh(), np.asarray(values, dtype=np.float64)
        if at.ndim not in (1, 2) or len(at) != len(self.places_):
            raise InvalidArgument(
                f"values have the shape {at.shape}, and {len(self.places_)} points were fitted"
            )
        if len(mesh.points) > len(at):
            at = _extended(mesh, at)
        found = mesh.locate(X)
        return np.einsum("qc,qc...->q...", found.weights, at[mesh.simplices[found.simplices]])

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The constructor's arguments."""
        return {name: getattr(self, name) for name in _PARAMETERS}

    def set_params(self, **params: Any) -> Reconstructor:
        """Raises: InvalidArgument, naming one that is none."""
        for name, value in params.items():
            if name not in _PARAMETERS:
                raise InvalidArgument(f"{name!r} is no parameter: there are {list(_PARAMETERS)}")
            setattr(self, name, value)
        return self

    def __repr__(self) -> str:
        given = ", ".join(f"{name}={value!r}" for name, value in self.get_params().items())
        return f"Reconstructor({given})"

    def _mesh(self) -> FinishedMesh:
        if not hasattr(self, "mesh_"):
            raise FailedPrecondition("this Reconstructor has no mesh yet: call fit(X)")
        return self.mesh_


def _extended(mesh: FinishedMesh, values: np.ndarray) -> np.ndarray:
    """Values at the first of the mesh's points, and harmonic ones at the others."""
    from scipy.sparse.linalg import spsolve

    stiffness, n = mesh.laplacian()[0].tocsr(), len(values)
    added = spsolve(stiffness[n:, n:].tocsc(), -(stiffness[n:, :n] @ values))
    return np.concatenate([values, np.asarray(added).reshape(-1, *values.shape[1:])])
