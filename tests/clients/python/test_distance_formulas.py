"""Solids as people write them, traced: their walls, their inside; and what is refused at once."""

import distance_formulas
import numpy as np
import pytest
import stellate
from stellate import solids as s


@pytest.mark.parametrize("f, walls, _epsilon, _chi", distance_formulas.FORMULAS)
def test_a_formula_is_traced(f, walls, _epsilon, _chi, rng):
    solid = s.traced(f, distance_formulas.BOX)
    x = rng.random((100_000, 3)) * 2.6 - 1.3
    assert (solid.contains(x) == (f(x) < 0)).all()
    table, _ = solid.label_table()
    assert len(table) == walls
    # Where a wall is zero on the surface it has a gradient, on the zero set itself as beside it.
    near = np.argsort(np.abs(f(x)))[:200]
    for wall in table:
        at = x[near]
        for _ in range(8):
            slope = wall.gradient(at)
            square = np.maximum((slope**2).sum(axis=1), 1e-12)
            at = at - np.clip(wall(at) / square, -0.1, 0.1)[:, None] * slope
        on = (np.abs(wall(at)) < 1e-12) & (np.abs(f(at)) < 1e-9)
        assert (np.linalg.norm(wall.gradient(at[on]), axis=1) > 0.05).all()


@pytest.mark.parametrize("f, words", distance_formulas.REFUSED)
def test_what_cannot_be_traced_is_refused_before_any_point_is_tried(f, words):
    calls = []

    def counted(p):
        calls.append(isinstance(p, np.ndarray))
        return f(p)

    with pytest.raises(stellate.InvalidArgument, match=words):
        s.traced(counted, distance_formulas.BOX)
    assert calls == [False]  # once, with symbols


def test_sides_in_one_plane_are_one_wall():
    """Two plates with their lower sides in one plane, of which one is a slab of another height."""

    def steps(p):
        low = np.maximum(np.abs(p[:, :2]).max(axis=1) - 1, np.abs(p[:, 2] + 0.3) - 0.2)
        high = np.maximum(np.abs(p[:, :2] - 0.2).max(axis=1) - 0.5, np.abs(p[:, 2]) - 0.5)
        return np.minimum(low, high)

    walls, _ = s.traced(steps, distance_formulas.BOX).label_table()
    x = np.array([[0.9, 0.8, -0.5], [0.2, 0.3, -0.5]])
    assert sum(bool((np.abs(wall(x)) < 1e-12).any()) for wall in walls) == 1


def test_a_pyramid_has_no_wall_with_a_crease_at_its_tip():
    walls, _ = s.traced(distance_formulas.pyramid, distance_formulas.BOX).label_table()
    tip, aside = np.array([0, 0, 0.8]), 1e-3 * np.eye(3)
    at_tip = [wall for wall in walls if abs(wall(tip[None])[0]) < 1e-12]
    assert len(at_tip) == 4
    for wall in at_tip:
        assert np.ptp(wall.gradient(tip + np.concatenate([aside, -aside])), axis=0).max() < 1e-12
