"""Linear finite elements on a mesh of any dimension k, in any R^d: two sparse matrices."""

import math

import numpy as np
import scipy.sparse


def assemble(mesh):
    """Stiffness (n, n) and mass (n, n) of the piecewise linear functions on a stellate.Mesh.

    With these M du/dt = -S u is the heat equation, and S u = t M u the eigenvalue problem of the
    Laplace-Beltrami operator. A simplex's metric is the Gram matrix of its edges, so it does not
    matter in which space it lies.
    """
    k, corners = mesh.dimension, mesh.points[mesh.simplices]
    edges = corners[:, 1:] - corners[:, :1]
    gram = edges @ edges.transpose(0, 2, 1)
    volume = (np.sqrt(np.linalg.det(gram)) / math.factorial(k))[:, None, None]
    slopes = np.hstack([-np.ones((k, 1)), np.eye(k)])  # of the barycentric coordinates
    stiffness = volume * (slopes.T @ np.linalg.inv(gram) @ slopes)
    mass = volume * (np.ones((k + 1, k + 1)) + np.eye(k + 1)) / ((k + 1) * (k + 2))
    return _gather(mesh, stiffness), _gather(mesh, mass)


def _gather(mesh, local):
    width, n = mesh.dimension + 1, len(mesh.points)
    rows = np.repeat(mesh.simplices, width, axis=1).ravel()
    columns = np.tile(mesh.simplices, (1, width)).ravel()
    return scipy.sparse.csc_matrix((local.ravel(), (rows, columns)), (n, n))
