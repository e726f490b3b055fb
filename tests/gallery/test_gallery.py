"""The gallery's programs do what they claim: each runs coarsely, and its mesh is what topology says."""

import ast
import json
import pathlib
import runpy
import subprocess
import sys

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
GALLERY, PAGES = ROOT / "gallery", ROOT / "docs" / "gallery"
sys.path.insert(0, str(ROOT / "clients" / "python"))
sys.path.insert(0, str(ROOT / "tests" / "clients" / "python"))  # topology
sys.path.insert(0, str(GALLERY))

import page  # noqa: E402
import stellate  # noqa: E402
import topology  # noqa: E402

# How much coarser here than in the gallery; components, orientable, Betti numbers modulo 2.
# For those with boundary, what it is made of: walls, edges, corners; and its Betti numbers.
BOUNDARY = {
    "composite": ([6, 12, 8], [1, 0, 1]),
    "drilled_and_joined": ([9, 12, 6], [1, 2, 1]),
    "drilled_block": ([7, 14, 8], [1, 2, 1]),
    "gyroid_box": ([6, 0, 21], [2, 2]),
    "hemisphere": ([1, 0, 0], [1, 1]),
    "joint_limits": ([1, 0, 0], [1, 2, 1]),
    "l_domain": ([6, 0, 6], [1, 1]),
    "linkage_limits": ([2, 0, 6], [1, 1]),
    "moebius_strip": ([1, 0, 0], [1, 1]),
    "schwarz": ([10, 32, 16], [1, 14, 1]),
    "solid_torus": ([1, 0, 0], [1, 2, 1]),
    "wedge": ([5, 9, 6], [1, 0, 1]),
}
STALE = 0.05  # by how much counts may differ from the page's: on another machine oracles round otherwise
KNOWN = {
    "cloud": (1.4, 1, True, [1, 2, 1]),
    "composite": (1.0, 1, True, [1, 0, 0, 0]),
    "copper": (1.0, 1, True, [1, 8, 1]),
    "cycloheptane": (2.0, 2, True, [2, 2]),
    "drilled_and_joined": (1.0, 1, True, [1, 1, 0, 0]),
    "drilled_block": (1.8, 1, True, [1, 1, 0, 0]),
    "genus_two": (1.0, 1, True, [1, 4, 1]),
    "grassmannian": (1.0, 1, True, [1, 1, 2, 1, 1]),
    "gyroid": (1.4, 1, True, [1, 10, 1]),
    "gyroid_box": (1.0, 1, True, [1, 3, 0]),
    "hemisphere": (2.0, 1, True, [1, 0, 0]),
    "invariant_torus": (1.4, 1, True, [1, 2, 1]),
    "joint_limits": (1.3, 1, True, [1, 1, 0, 0]),
    "klein_bottle": (1.0, 1, False, [1, 2, 1]),
    "knot": (1.0, 1, True, [1, 2, 1]),
    "l_domain": (2.0, 1, True, [1, 0, 0]),
    "level_set": (1.6, 1, True, [1, 2, 1]),
    "linkage": (1.0, 1, True, [1, 8, 1]),
    "linkage_limits": (1.0, 1, True, [1, 2, 0]),
    "moebius_strip": (1.3, 1, False, [1, 1, 0]),
    "neural": (1.0, 2, True, [2, 4, 2]),
    "orthogonal": (1.5, 2, True, [2, 2, 2, 2]),
    "product": (1.2, 1, True, [1, 1, 1, 1]),
    "projective_plane": (1.5, 1, False, [1, 1, 1]),
    "remeshed": (1.2, 1, True, [1, 2, 1]),
    "rotations": (1.8, 1, True, [1, 1, 1, 1]),
    "schwarz": (1.0, 1, True, [1, 7, 0, 0]),
    "shapes": (2.0, 1, True, [1, 0, 1]),
    "solid_torus": (1.3, 1, True, [1, 1, 0, 0]),
    "three_torus": (1.3, 1, True, [1, 3, 3, 1]),
    "wedge": (1.0, 1, True, [1, 0, 0, 0]),
}


def euler(betti):
    return sum((-1) ** i * b for i, b in enumerate(betti))


def test_all_programs_are_known_and_short():
    assert page.programs() == sorted(KNOWN)
    for name in KNOWN:
        source = (GALLERY / f"{name}.py").read_text()
        docstring = ast.get_docstring(ast.parse(source))
        code = [line for line in source.splitlines() if line.strip() and line[0] != "#"]
        assert len(code) - len([line for line in docstring.splitlines() if line]) <= 30, name
        title, words = docstring.split("\n\n")
        assert "\n" not in title and words


@pytest.mark.parametrize("name", sorted(KNOWN))
def test_a_program_meshes_what_it_claims(name, tmp_path, monkeypatch):
    coarser, components, orientable, betti = KNOWN[name]
    mesh_as_ever = stellate.mesh
    monkeypatch.setattr(
        stellate, "mesh", lambda oracle, epsilon, **more: mesh_as_ever(oracle, coarser * epsilon, **more)
    )  # fmt: skip
    monkeypatch.chdir(tmp_path)
    mesh = runpy.run_path(str(GALLERY / f"{name}.py"))["mesh"]
    assert mesh.certified, mesh.report
    assert topology.is_closed(mesh.simplices) == (name not in BOUNDARY)
    if name in BOUNDARY:
        ends_at_its_walls(mesh, *BOUNDARY[name])
    assert topology.component_count(mesh.simplices) == components
    assert topology.euler_characteristic(mesh.simplices) == euler(betti)
    assert (mesh.oriented_simplices() is not None) == orientable
    if mesh.dimension <= 3:  # of the fourth dimension that would take a minute
        assert topology.betti_numbers(mesh.simplices) == betti
    if mesh.dimension <= 2 and name not in BOUNDARY:
        assert topology.is_manifold(mesh.simplices)
    assert share_drawn(tmp_path / f"{name}.png") > 0.01
    if coarser == 1.0:  # as the page has it
        fact = json.loads((PAGES / "facts.json").read_text())[name]
        assert len(mesh.points) == pytest.approx(fact["vertices"], rel=STALE), "gallery/build"
        assert len(mesh.simplices) == pytest.approx(fact["simplices"], rel=STALE)


def ends_at_its_walls(mesh, counts, betti):
    assert faces_of(mesh) == counts
    rim = np.concatenate([face.simplices for face in mesh.boundary])
    facets = np.concatenate(
        [np.delete(mesh.simplices, i, axis=1) for i in range(mesh.dimension + 1)]
    )
    facets, times = np.unique(facets, axis=0, return_counts=True)
    assert times.max() == 2
    assert set(map(tuple, rim)) == set(map(tuple, facets[times == 1]))
    assert topology.is_closed(rim) and topology.is_manifold(rim)
    assert topology.betti_numbers(rim) == betti


def faces_of(mesh):
    corners = sum(len(face.simplices) for face in mesh.corners)
    return [len(mesh.boundary), len(mesh.edges), corners]


def share_drawn(file):
    """Of a picture's pixels, those that are not white."""
    from matplotlib import image

    return float((np.asarray(image.imread(file))[..., :3] < 0.99).any(axis=2).mean())


def test_elements_on_compositions_come_to_what_is_known(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    membrane = runpy.run_path(str(GALLERY / "l_domain.py"))
    assert 9.6397 < membrane["values"][0] < 9.6397 * 1.01  # Fox, Henrici and Moler's, from above
    composite = runpy.run_path(str(GALLERY / "composite.py"))
    share = composite["mesh"].region(2).volume / composite["mesh"].volume
    # Hashin's and Shtrikman's bounds of well mixed grains, and the plain ones of any.
    low = 1 / ((1 - share) + share / 10)
    high = (1 - share) + 10 * share
    assert low < composite["conductance"] < high
    assert composite["conductance"] == pytest.approx(1 + 3 * share * 9 / (12 - 9 * share), rel=0.1)


def test_coppers_fermi_surface_holds_one_electron_an_atom(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    copper = runpy.run_path(str(GALLERY / "copper.py"))
    k = np.random.default_rng(1).random((400_000, 3)) @ copper["lattice"]
    inside = np.array([1, copper["b"], copper["c"]]) @ copper["harmonics"](k) > copper["level"]
    assert inside.mean() == pytest.approx(0.5, rel=0.01)


def test_the_page_is_what_its_programs_and_facts_say():
    facts = json.loads((PAGES / "facts.json").read_text())
    assert sorted(facts) == sorted(KNOWN)
    assert (PAGES / "index.md").read_text() == page.text(facts), "gallery/build --page"
    for name, fact in facts.items():
        _, components, orientable, betti = KNOWN[name]
        assert fact["certified"]
        assert (fact["components"], fact["orientable"]) == (components, orientable)
        assert fact["euler_characteristic"] == euler(betti)
        assert fact.get("faces") == (BOUNDARY[name][0] if name in BOUNDARY else None)
        picture = PAGES / f"{name}.png"
        assert picture.stat().st_size < 60_000
        assert share_drawn(picture) > 0.01


def test_the_build_makes_one_picture_and_the_page_when_all_facts_are_there(tmp_path):
    def build(*more):
        command = [sys.executable, "-B", GALLERY / "build", "--output", tmp_path, *more]
        return subprocess.run(command, capture_output=True, text=True)

    alone = build("--only", "shapes")
    assert alone.returncode == 1 and "for want of cloud" in alone.stderr
    assert "shapes: " in alone.stdout and "vertices, certified" in alone.stdout
    assert 0.1 < share_drawn(tmp_path / "shapes.png") < 0.9
    made = json.loads((tmp_path / "facts.json").read_text())
    kept = json.loads((PAGES / "facts.json").read_text())
    assert list(made) == ["shapes"]
    for key in kept["shapes"].keys() - {"vertices", "simplices", "verdict"}:
        assert made["shapes"][key] == kept["shapes"][key]
    assert made["shapes"]["vertices"] == pytest.approx(kept["shapes"]["vertices"], rel=STALE)

    (tmp_path / "facts.json").write_text(json.dumps(kept))
    assert build("--page").returncode == 0
    assert (tmp_path / "index.md").read_text() == (PAGES / "index.md").read_text()
    assert build("--only", "nonsense").returncode == 2
    assert build("--jobs", "0").returncode == 2
