"""Oracles for manifolds that are given by equations, charts, distances, points, triangles...

Each is an object that `stellate.mesh` takes; `stellate.check` examines them like any other.
ImplicitManifold and ImplicitSolid are at the top of `stellate`, too.
"""

from ._bounded import ManifoldWithBoundary
from ._chart import Chart
from ._cloud import PointCloud
from ._combined import LevelSet, Product, Transformed
from ._constraints import ConstraintSet
from ._distance import SignedDistance
from ._implicit import ImplicitManifold
from ._kept import kept
from ._linkage import Linkage
from ._network import NeuralImplicit
from ._parametrized import Parametrized
from ._periodic import PeriodicCell
from ._periodic_mesh import PeriodicMesh
from ._quotient import Quotient
from ._triangles import TriangleMesh
from ._units import in_units
from ._walls import Clipped, HalfSpace, ImplicitSolid, Solid

__all__ = [
    "Chart",
    "Clipped",
    "ConstraintSet",
    "HalfSpace",
    "ImplicitManifold",
    "ImplicitSolid",
    "LevelSet",
    "Linkage",
    "ManifoldWithBoundary",
    "NeuralImplicit",
    "Parametrized",
    "PeriodicCell",
    "PeriodicMesh",
    "PointCloud",
    "Product",
    "Quotient",
    "SignedDistance",
    "Solid",
    "Transformed",
    "TriangleMesh",
    "in_units",
    "kept",
]
