"""The equations of clients/shared/singular.json: Python and C++ say of the same that they lose rank."""

import json
import pathlib

import numpy as np
import pytest
import stellate
from stellate._rank import find_singular
from stellate.oracle import CheckedOracle

_FILE = pathlib.Path(__file__).resolve().parents[3] / "clients" / "shared" / "singular.json"
_CASES = json.loads(_FILE.read_text())["cases"]


def _oracle(equations):
    def f(x):
        terms = [
            [c * np.prod(x ** np.array(powers), axis=1) for c, *powers in one] for one in equations
        ]
        return np.stack([np.sum(one, axis=0) for one in terms], axis=1)

    d = len(equations[0][0]) - 1
    return stellate.ImplicitManifold(
        f, ambient_dimension=d, dimension=d - len(equations), bounding_box=([-1.5] * d, [1.5] * d)
    )


@pytest.mark.parametrize("case", _CASES, ids=[case["name"] for case in _CASES])
def test_equations_lose_rank_where_they_are_known_to(case):
    finding = find_singular(CheckedOracle(_oracle(case["equations"])), 1)
    if not case["singular"]:
        assert finding is None
        return
    assert finding is not None and finding.code == "SINGULAR"
    off = np.abs(np.array(case["singular"]) - finding.place).sum(axis=1)
    assert off.min() < 1e-4
