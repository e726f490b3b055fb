"""Manifolds by equations: where derivatives come from, and what they cost."""

import sys

import fake_autodiff
import numpy as np
import pytest
import stellate
import topology
from test_implicit import implicit_rotations, implicit_torus

SQUARE = (np.full(4, -1.3), np.full(4, 1.3))
LIBRARIES = ["autograd", "jax", "torch"]


def clifford(x):  # in what numpy, autograd, jax and torch have in common
    return x[:, ::2] ** 2 + x[:, 1::2] ** 2 - 1


def clifford_jacobian(x):
    jacobian = np.zeros((len(x), 2, 4))
    jacobian[:, 0, 0], jacobian[:, 0, 1] = 2 * x[:, 0], 2 * x[:, 1]
    jacobian[:, 1, 2], jacobian[:, 1, 3] = 2 * x[:, 2], 2 * x[:, 3]
    return jacobian


def made(jacobian, f=clifford):
    return stellate.ImplicitManifold(
        f, jacobian, ambient_dimension=4, dimension=2, bounding_box=SQUARE
    )


@pytest.mark.parametrize("library", LIBRARIES)
def test_functions_that_give_their_own_derivatives(library, monkeypatch, rng):
    fake_autodiff.provide(library, monkeypatch)
    ours, exact = made(library), made(clifford_jacobian)
    x = rng.uniform(*SQUARE, (300, 4))
    p = ours.closest_point(x)
    assert np.abs(p - exact.closest_point(x)).max() < 1e-13
    assert np.abs(p - made(None).closest_point(x)).max() < 1e-9
    bases = ours.tangent_basis(p)
    assert np.abs(clifford_jacobian(p) @ bases).max() < 1e-13
    q, found = ours.intersect_flat(p + 0.02, bases, np.ones(len(p)))
    assert found.all() and np.abs(clifford(q)).max() < 1e-12
    parts = np.concatenate([ours.closest_point(part) for part in np.split(x, [1, 2, 150])])
    assert parts.tobytes() == p.tobytes()


def test_meshes_with_derivatives_of_its_own(monkeypatch, server):
    fake_autodiff.provide("autograd", monkeypatch)
    mesh = stellate.mesh(made("autograd"), 0.4, server)
    assert mesh.certified
    topology.assert_closed_manifold(mesh, 0, [1, 2, 1])


@pytest.mark.parametrize("library", LIBRARIES)
def test_a_library_that_is_not_there_is_named(library, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(
        stellate.InvalidArgument, match=f"needs {library}, which cannot be imported"
    ):
        made(library)


def test_a_library_that_is_not_known_is_named():
    with pytest.raises(stellate.InvalidArgument, match="'torch', and is 'sympy'"):
        made("sympy")


def test_single_precision_is_named():
    with pytest.raises(stellate.OracleError, match="f returned float32.*float64") as caught:
        made(None, lambda x: clifford(x).astype(np.float32)).closest_point(np.ones((1, 4)))
    assert caught.value.reason == "ORACLE_PRECISION"
    rough = made(lambda x: clifford_jacobian(x).astype(np.float32))
    with pytest.raises(stellate.OracleError, match="jacobian returned float32"):
        rough.tangent_basis(np.ones((1, 4)))


class Counted:
    """A function of batches that counts its calls and the points in them."""

    def __init__(self, f):
        self.f, self.calls, self.points = f, 0, 0

    def __call__(self, x):
        assert len(x), "a call for nothing"
        self.calls, self.points = self.calls + 1, self.points + len(x)
        return self.f(x)


@pytest.mark.parametrize(
    "make, values, flat_values, calls",
    [(implicit_torus, 19, 7, 30), (implicit_rotations, 42, 13, 36)],
)
def test_differences_are_shared_and_few(make, values, flat_values, calls, rng):
    """Values of f a query. Newton's method with a new Jacobian each step takes three to eight times."""
    m = make()
    counted = m._equations._f = Counted(m._equations._f)
    p = m.closest_point(m.closest_point(rng.uniform(*m.bounding_box, (300, m.ambient_dimension))))
    x = p + rng.normal(scale=0.05 / np.sqrt(m.ambient_dimension), size=p.shape)
    counted.calls = counted.points = 0
    closest = m.closest_point(x)
    assert counted.points <= values * len(x) and counted.calls <= calls
    exact = m.tangent_basis(closest)
    assert np.abs(np.einsum("ndk,nd->nk", exact, x - closest)).max() < 1e-10
    counted.calls = counted.points = 0
    _, found = m.intersect_flat(x, exact, np.ones(len(x)))
    assert found.all()
    assert counted.points <= flat_values * len(x) and counted.calls <= calls


def test_one_call_for_all_differences(rng):
    f = Counted(clifford)
    m = made(None, f)
    m.tangent_basis(rng.uniform(*SQUARE, (1, 4)))  # and how exact f is, once
    f.calls = f.points = 0
    m.tangent_basis(rng.uniform(*SQUARE, (50, 4)))
    assert (f.calls, f.points) == (1, 50 * 8)


def wall(x):
    return x[:, 0] + 0.3 * x[:, 3] ** 2


@pytest.mark.parametrize("given, cut, most", [(0, 0, 138), (1, 0, 72), (0, 1, 220), (1, 1, 107)])
def test_a_mesh_takes_few_values(given, cut, most, server):
    """Of F and its Jacobian, a vertex: with a Jacobian or without, with a wall or without."""
    f, slopes = Counted(clifford), Counted(clifford_jacobian)
    oracle = made(slopes if given else None, f)
    if cut:
        oracle = stellate.oracles.Clipped(oracle, [wall])
    mesh = stellate.mesh(oracle, 0.2, server=server, speculative=False)
    assert mesh.certified
    assert f.points + slopes.points <= most * len(mesh.points)
