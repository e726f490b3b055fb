"""Finite elements on meshed manifolds, against what is known exactly."""

import pathlib
import re
import sys

import numpy as np
import pytest
import scipy.sparse.linalg
import shapes
import stellate

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "examples/finite_elements"))

import elements  # noqa: E402
import heat  # noqa: E402
import turing  # noqa: E402


def test_linear_functions_have_their_exact_energy_and_mass():
    torus = shapes.torus()
    stiffness, mass = elements.assemble(torus)
    ones, x = np.ones(len(torus.points)), torus.points @ [0.3, -1.1, 0.7]
    a, b, c = (torus.points[torus.simplices[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert np.isclose(ones @ mass @ ones, area, rtol=1e-12, atol=0)
    assert np.abs(stiffness @ ones).max() < 1e-12 * np.abs(stiffness).max()
    # The coordinates together have the gradient's square k everywhere.
    energy = sum(axis @ stiffness @ axis for axis in torus.points.T)
    assert np.isclose(energy, 2 * area, rtol=1e-12, atol=0)
    assert x @ mass @ x > 0


def test_heat_on_the_rotations_decays_at_the_laplacians_rate():
    errors = []
    page = (ROOT / "docs/using/finite-elements.md").read_text()
    for epsilon in (0.6, 0.45):
        times, temperatures, mass = heat.cool(epsilon)
        vertices, rate = re.search(rf"\| {epsilon} \| ([\d,]+) \| ([\d.]+) \|", page).groups()
        assert temperatures.shape[1] == pytest.approx(int(vertices.replace(",", "")), rel=0.05)
        assert heat.decay_rate(times, temperatures, mass) == pytest.approx(float(rate), rel=0.01)
        kept = (temperatures @ mass).sum(axis=1)
        assert np.allclose(kept, kept[0], rtol=1e-12, atol=0)
        errors.append(heat.decay_rate(times, temperatures, mass) - 1)
    # Of second order: 1.07 and 1.04 are what elements of these sizes give, from above.
    assert 0 < errors[1] < errors[0] < 0.1
    assert 1.3 < errors[0] / errors[1] < 2.4  # (0.6 / 0.45)^2 is 1.8


def test_a_pattern_on_the_double_torus_grows_at_the_predicted_rate():
    mesh = turing.surface(0.1)
    stiffness, mass = elements.assemble(mesh)
    assert stellate.Mesh(mesh.points, mesh.simplices).oriented_simplices() is not None
    eigenvalue, function = turing.fastest(stiffness, mass)
    step, count = 1e-4, 2000
    along = [
        function @ (mass @ (u[0] - turing.EVEN[0]))
        for u in turing.steps(stiffness, mass, turing.noise(len(mesh.points), 1e-6), step, count)
    ]
    late = np.arange(count // 2, count)  # the mode that dies out has died out
    rate = np.polyfit(step * late, np.log(np.abs(along)[late]), 1)[0]
    assert turing.growth(eigenvalue) > 10
    assert np.isclose(rate, turing.growth(eigenvalue), rtol=1e-3, atol=0)


def test_even_concentrations_rest_and_the_pattern_is_bounded():
    assert np.allclose(turing.react(turing.EVEN[:, None]), 0, rtol=0, atol=1e-12)
    h = 1e-6
    for j in range(2):
        moved = (turing.EVEN + h * np.eye(2)[j])[:, None]
        slope = turing.react(moved)[:, 0] / h / turing.GAMMA
        assert np.allclose(slope, turing.JACOBIAN[:, j], rtol=0, atol=1e-4)


def test_a_curve_and_a_solid_have_the_spectra_of_theirs():
    """The circle's eigenvalues are 0, 1, 1, 4, 4; the three-sphere's 0 and 3 four times."""
    circle = stellate.mesh(stellate.manifolds.Sphere(1), 0.05)
    sphere = stellate.mesh(stellate.manifolds.Sphere(3), 0.3)
    for mesh, known in ((circle, [0, 1, 1, 4, 4]), (sphere, [0, 3, 3, 3, 3])):
        stiffness, mass = elements.assemble(mesh)
        values = scipy.sparse.linalg.eigsh(
            stiffness, len(known), mass, sigma=-1, return_eigenvectors=False
        )
        assert np.allclose(np.sort(values), known, rtol=0.07, atol=1e-9)
