"""stellate.check where equations lose rank: tips, bars on one line.

Other equations: test_rank_shared.py.
"""

import numpy as np
import pytest
import stellate
from shapes import equation
from stellate import manifolds, oracles


def tip(x):
    return (x * x).sum(axis=1) ** 2 - x[:, 0] ** 2 + x[:, 1] ** 2 + x[:, 2] ** 2


TIP = equation(tip)


def beyond(least):
    """What of the figure with the tip at the origin lies where x >= least."""
    return stellate.ImplicitManifold(
        tip,
        ambient_dimension=3,
        dimension=2,
        bounding_box=([-1.4] * 3, [1.4] * 3),
        inequalities=[lambda x: x[:, 0] - least],
    )


CROSSINGS = {
    "a rhombus of bars, on one line": (
        oracles.Linkage(
            [("a", "p", 1.0), ("p", "q", 1.0), ("q", "b", 1.0)], {"a": (0, 0), "b": (1, 0)}
        ),
        lambda p: abs(p[1]) + abs(p[3]),
    ),
    "a tip": (TIP, lambda p: np.abs(p).sum()),
    "a tip that walls leave": (beyond(-0.5), lambda p: np.abs(p).sum()),
}


@pytest.mark.parametrize("name", CROSSINGS)
def test_where_equations_lose_rank_is_told(name):
    oracle, off = CROSSINGS[name]
    (finding,) = [f for f in stellate.check(oracle).findings if f.code == "SINGULAR"]
    assert off(finding.place) < 1e-4
    assert "no epsilon will do" in finding.advice


@pytest.mark.parametrize(
    "oracle",
    [
        manifolds.tanglecube(),
        oracles.Linkage(
            [("a", "p", 1.0), ("p", "q", 1.01), ("q", "b", 1.0)], {"a": (0, 0), "b": (1, 0)}
        ),
        beyond(0.2),
    ],
    ids=["tanglecube", "nearly a rhombus", "a tip cut out"],
)
def test_steep_and_flat_equations_are_not_called_singular(oracle):
    assert "SINGULAR" not in stellate.check(oracle).codes
