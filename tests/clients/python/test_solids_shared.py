"""The solids of clients/shared/solids.json: Python and C++ have the same walls and labels of them.

To record them again, with the cases below:  PYTHONPATH=clients/python tests/clients/python/test_solids_shared.py
"""

import json
import pathlib

import numpy as np
import pytest
from stellate import solids as s

_FILE = pathlib.Path(__file__).resolve().parents[3] / "clients" / "shared" / "solids.json"
_PLACES = ((0.31, -0.17, 0.23), (-0.62, 0.48, -0.91), (1.13, 0.77, -0.35))
_Z = [0, 0, 1]

# In the words of the command line, and in Python.
_CASES = {
    "ball(1.3)": lambda: s.Ball(1.3),
    "box(-1, 1)": lambda: s.Box([-1] * 3, [1] * 3),
    "box((-1, -1), (1, 1)) | ball(0.6, at=(1.1, 0.1))": lambda: (
        s.Box([-1, -1], [1, 1]) | s.Ball(0.6, at=(1.1, 0.1))
    ),
    "box(-1,1) & ball(1.3) - cylinder(x, .5) | ball(.45, at=(.95, .9, .2))": lambda: (
        s.Box([-1] * 3, [1] * 3) & s.Ball(1.3) - s.Cylinder(0.5, axis="x")
        | s.Ball(0.45, at=(0.95, 0.9, 0.2))
    ),
    "(box(-1, 1) & ball(1.3)) - (cylinder(x, 0.5) | cylinder(y, 0.5, 4) | cylinder(0.5))": lambda: (
        (s.Box([-1] * 3, [1] * 3) & s.Ball(1.3))
        - (s.Cylinder(0.5, axis="x") | s.Cylinder(0.5, 4, axis="y") | s.Cylinder(0.5))
    ),
    "box(-1, 1) - cylinder(0.5, 1, at=(0, 0, 1))": lambda: (
        s.Box([-1] * 3, [1] * 3) - s.Cylinder(0.5, 1, at=(0, 0, 1))
    ),
    "ball(2) & halfspace((0, 0, 2), 2)": lambda: s.Ball(2) & s.HalfSpace([0, 0, 2], 2),
    "cone(1, 1.5) & ~halfspace((0, 0, 1))": lambda: s.Cone(1, 1.5) & ~s.HalfSpace(_Z),
    "cone(axis=(1, 2, 3), 0.8, 1.2, 0.3, at=(0.1, 0, 0))": lambda: s.Cone(
        0.8, 1.2, 0.3, axis=[1, 2, 3], at=(0.1, 0, 0)
    ),
    "torus(0.8, 0.3).rotated(x, 30) ^ capsule((-1, 0, 0), (1, 0, 0), 0.4)": lambda: (
        s.Torus(0.8, 0.3).rotated(s.rotation("x", np.pi / 6))
        ^ s.Capsule([-1, 0, 0], [1, 0, 0], 0.4)
    ),
    "ball() - ball().offset(-0.5)": lambda: s.Ball() - s.Ball().offset(-0.5),
    "ball() | ball().at(3, 0, 0) | ball(0.4)": lambda: (
        s.Ball() | s.Ball().at([3, 0, 0]) | s.Ball(0.4)
    ),
    "(box(-1, 1) - ball(0.7, at=(1, 1, 1))).scaled(2).rotated((1, 2, 3), 40).at((1, 2, 3))": lambda: (
        (s.Box([-1] * 3, [1] * 3) - s.Ball(0.7, at=(1, 1, 1)))
        .scaled(2)
        .rotated(s.rotation([1, 2, 3], np.radians(40)))
        .at([1, 2, 3])
    ),
    "blend(ball(0.6), ball(0.5, at=(0.8, 0, 0)), 0.2) & box(-1, 2)": lambda: (
        s.blend(s.Ball(0.6), s.Ball(0.5, at=(0.8, 0, 0)), 0.2) & s.Box([-1] * 3, [2] * 3)
    ),
    "blend(ball(), cylinder(x, 0.3), 0.1, difference)": lambda: s.blend(
        s.Ball(), s.Cylinder(0.3, axis="x"), 0.1, "-"
    ),
    "blend(ball(), ball(at=(0.9, 0, 0)), 0.1, join=intersection)": lambda: s.blend(
        s.Ball(), s.Ball(at=(0.9, 0, 0)), 0.1, "&"
    ),
    "box(-1, 1) | box((1, -0.5, -0.5), (2, 0.5, 0.5))": lambda: (
        s.Box([-1] * 3, [1] * 3) | s.Box([1, -0.5, -0.5], [2, 0.5, 0.5])
    ),
    "matrix=box(-1, 1); grain=ball(0.6)": lambda: s.Labels(
        matrix=s.Box([-1] * 3, [1] * 3), grain=s.Ball(0.6)
    ),
    "a=ball(); b=ball(at=(0.9, 0, 0)); c=halfspace((0, 0, 1)) & ball(0.5)": lambda: s.Labels(
        a=s.Ball(), b=s.Ball(at=(0.9, 0, 0)), c=s.HalfSpace(_Z) & s.Ball(0.5)
    ),
}

# Each is the largest where its centre is the nearest, less what it is lowered by; within a solid.
_PHASES = {
    "ball(1)": [[0.8, 0.2, 0.1, 0], [-0.5, 0.7, -0.2, 0.1], [-0.3, -0.8, 0.3, 0]],
    "torus(1, 0.4)": [[1, 1, 1, 0], [1, -1, -1, 0.2], [-1, 1, -0.9, 0], [-1, -1.1, 1, 0]],
    "box(-1, 1) - cylinder(0.3)": [[0.5, 0, 0, 0], [-0.5, 0.1, 0, 0]],
}


def _signs(labels):
    """A character for each vector of signs."""
    return "".join("-" if label < 0 else str(label) for label in labels)


def _record(expression):
    solid = _CASES[expression]()
    x = np.array(_PLACES)[:, : solid.dimension]
    lower, upper = solid.bounding_box
    case = {
        "expression": expression,
        "box": [*lower.tolist(), *upper.tolist()],
        # What a server is served: labels are empty where the solid is all that is positive.
        "clearances": solid.clearances(x).T.tolist(),
        "labels": "" if solid.labels is None else _signs(solid.labels),
    }
    if isinstance(solid, s.Solid):
        walls, table = solid.label_table()
        case["walls"] = [wall(x).tolist() for wall in walls]
        case["table"] = _signs(table)
        case["inside"] = solid.contains(x).tolist()
    return case


def _record_phases(within):
    def grain(centre):
        return lambda x: -((x - np.array(centre[:3])) ** 2).sum(axis=1) - centre[3]

    solids = {
        "ball(1)": s.Ball(1),
        "torus(1, 0.4)": s.Torus(1, 0.4),
        "box(-1, 1) - cylinder(0.3)": s.Box([-1] * 3, [1] * 3) - s.Cylinder(0.3),
    }
    phases = s.Phases(*map(grain, _PHASES[within])) & solids[within]
    return {
        "within": within,
        "grains": _PHASES[within],
        "clearances": phases.clearances(np.array(_PLACES)).T.tolist(),
        "labels": _signs(phases.labels),
        "closures": [list(closure) for closure in phases.closures],
        "label_at": phases.label_at(np.array(_PLACES)).tolist(),
    }


@pytest.mark.parametrize("number", range(len(_PHASES)))
def test_phases_are_as_recorded(number):
    want = json.loads(_FILE.read_text())["phases"][number]
    have = _record_phases(list(_PHASES)[number])
    assert np.allclose(have.pop("clearances"), want.pop("clearances"), rtol=0, atol=1e-12)
    assert have == want


@pytest.mark.parametrize("number", range(len(_CASES)))
def test_solids_are_as_recorded(number):
    shared = json.loads(_FILE.read_text())
    assert [case["expression"] for case in shared["cases"]] == list(_CASES)
    assert shared["places"] == [list(place) for place in _PLACES]
    want = shared["cases"][number]
    have = _record(want["expression"])
    assert set(have) == set(want)
    for name in want:
        if name in ("box", "clearances", "walls"):
            assert np.allclose(have[name], want[name], rtol=0, atol=1e-12), name
        else:
            assert have[name] == want[name], name


if __name__ == "__main__":
    cases = ",\n".join(json.dumps(_record(expression)) for expression in _CASES)
    phases = ",\n".join(json.dumps(_record_phases(within)) for within in _PHASES)
    places = json.dumps(_PLACES)
    _FILE.write_text(
        f'{{"places": {places},\n"cases": [\n{cases}\n],\n"phases": [\n{phases}\n]}}\n'
    )
