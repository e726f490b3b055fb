"""Meshes that go into files as they come: stellate.mesh(..., to=...)."""

import os
import pathlib
import resource
import signal
import threading

import numpy as np
import pytest
import stellate
from stellate import _run, manifolds, oracles

ROOM = ([-1.3] * 3, [1.3] * 3)


def two_materials():
    """A ball of radius 1/2 in one of radius 1."""
    walls = [lambda x, r=r: r**2 - (x**2).sum(axis=1) for r in (1.0, 0.5)]
    return oracles.Solid(walls, ROOM, labels=[0, 1, 0, 2])


def half_torus():
    return oracles.Clipped(
        manifolds.Torus(), [oracles.HalfSpace([1, 0, 0]), oracles.HalfSpace([0, 1, 0.2])]
    )


def ellipsoid():
    return stellate.ImplicitManifold(
        lambda x: ((x / [3, 1, 1]) ** 2).sum(axis=1) - 1,
        ambient_dimension=3,
        dimension=2,
        bounding_box=([-3.9, -1.3, -1.3], [3.9, 1.3, 1.3]),
    )


@pytest.fixture
def streamed(monkeypatch):
    """Of each mesh so far, whether it came in parts; no mesh that does is held."""
    seen, real = [], _run.stream

    def stream(*arguments, **more):
        saved = real(*arguments, **more)
        seen.append(saved is not None)
        return saved

    monkeypatch.setattr(_run, "stream", stream)
    return seen


CASES = {
    "torus": (manifolds.Torus, 0.3, {}, "txt off obj ply msh vtu"),
    "so3": (manifolds.SpecialOrthogonal3, 0.6, {}, "txt vtu"),
    "half torus": (half_torus, 0.3, {}, "txt off obj ply msh vtu"),
    "materials": (two_materials, 0.3, {}, "txt obj msh vtu"),
    "unfinished": (half_torus, 0.3, {"max_vertices": 20}, "txt off obj msh vtu"),
    "scaled": (ellipsoid, 0.3, {"scale": [3, 1, 1]}, "txt vtu"),
    "kept in its box": (
        lambda: stellate.ImplicitManifold(
            lambda x: x[:, 2], ambient_dimension=3, dimension=2, bounding_box=([-1] * 3, [1] * 3)
        ),
        0.4,
        {"keep": "box"},
        "obj vtu",
    ),
}


@pytest.mark.filterwarnings("ignore::stellate.UncertifiedWarning")
@pytest.mark.parametrize("case", CASES)
def test_files_are_those_of_the_mesh(case, server, streamed, tmp_path):
    make, epsilon, options, endings = CASES[case]
    endings = endings.split()
    mesh = stellate.mesh(make(), epsilon, server=server, **options)
    paths = [tmp_path / f"a.{ending}" for ending in endings]
    saved = stellate.mesh(make(), epsilon, server=server, to=paths, **options)
    assert streamed == [True]
    assert saved.certified == mesh.certified == (case != "unfinished")
    assert saved.report.certificate.verdict == mesh.report.certificate.verdict
    for ending, path in zip(endings, paths):
        mesh.save(tmp_path / f"b.{ending}")
        assert path.read_bytes() == (tmp_path / f"b.{ending}").read_bytes(), ending
    assert saved.paths == tuple(map(str, paths)) and saved.name == ""
    assert (saved.vertices, saved.simplices) == (len(mesh.points), len(mesh.simplices))
    if "vtu" in endings:
        assert np.array_equal(saved.points, mesh.points)
        same = mesh.oriented_simplices()
        if same is None:
            same = mesh.simplices
        if mesh.labels is not None:  # region by region
            same = same[np.argsort(mesh.labels, kind="stable")]
        assert np.array_equal(saved.cells, same)
    assert len(list(tmp_path.iterdir())) == 2 * len(endings)


@pytest.mark.parametrize("ending, options", [("stl", {}), ("vtu", {"boundary_only": True})])
def test_what_is_held_whole_comes_all_the_same(ending, options, server, streamed, tmp_path):
    cube = oracles.Solid([], ROOM, box=([-1] * 3, [1] * 3))
    saved = stellate.mesh(cube, 0.65, server=server, to=tmp_path / f"a.{ending}", **options)
    assert streamed == [False] and saved.certified
    stellate.mesh(cube, 0.65, server=server, **options).save(tmp_path / f"b.{ending}")
    assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending}").read_bytes()


def test_a_checkpoint_and_a_private_server(tmp_path):
    folder, file = tmp_path / "kept", tmp_path / "a.vtu"
    first = stellate.mesh(manifolds.Torus(), 0.3, checkpoint=folder, to=file)
    before = file.read_bytes()
    again = stellate.mesh(manifolds.Torus(), 0.3, checkpoint=folder, to=file)
    assert first.certified and again.certified and file.read_bytes() == before
    assert stellate.mesh(manifolds.Torus(), 0.3, to=file).certified
    assert file.read_bytes() == before


def test_it_stays_on_its_server_where_it_is_asked_to(server, client, tmp_path):
    saved = stellate.mesh(
        manifolds.Torus(), 0.3, server=server, keep_on_server=True, to=tmp_path / "a.txt"
    )
    again = stellate.download(saved.name, server=server)
    client.delete(saved.name)
    assert np.array_equal(stellate.load_txt(tmp_path / "a.txt").simplices, again.simplices)
    stellate.mesh(manifolds.Torus(), 0.3, server=server, to=tmp_path / "a.txt")
    assert saved.name not in {info.name for info in client.list()}


def test_a_mesh_that_a_finer_one_follows_goes_into_no_file(
    server, client, streamed, monkeypatch, tmp_path
):
    before, finer = {info.name for info in client.list()}, [(0.3, "it was too coarse")]
    monkeypatch.setattr(_run.Run, "_finer", lambda self, report: finer.pop() if finer else None)
    seen = []
    saved = stellate.mesh(
        manifolds.Torus(), 0.4, server=server, to=tmp_path / "a.vtu", on_progress=seen.append
    )
    assert saved.certified and streamed == [True] and seen[-1].vertices == saved.vertices
    assert saved.report.epsilon == 0.3 and saved.report.epsilon_reason == "it was too coarse"
    assert {info.name for info in client.list()} == before


def test_mistakes_are_told_before_anything_is_meshed(server, tmp_path):
    with pytest.raises(TypeError, match="either save or to"):
        stellate.mesh(manifolds.Torus(), 0.3, save=tmp_path / "a.txt", to=tmp_path / "b.txt")
    with pytest.raises(stellate.SaveError, match="surfaces"):
        stellate.mesh(manifolds.SpecialOrthogonal3(), 0.3, to=tmp_path / "a.stl")
    with pytest.raises(FileNotFoundError, match="no folder"):
        stellate.mesh(manifolds.Torus(), 0.3, to=tmp_path / "missing" / "a.vtu")
    with (
        pytest.raises(stellate.NotCertified, match="a.txt"),
        pytest.warns(stellate.UncertifiedWarning, match="a.txt") as warned,
    ):
        stellate.mesh(
            half_torus(), 0.3, server=server, max_vertices=20, require_certified=True,
            to=tmp_path / "a.txt",
        )  # fmt: skip
    assert [w.filename for w in warned] == [__file__]
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


@pytest.mark.parametrize("make", [manifolds.Torus, half_torus])
def test_a_disk_that_is_full_does_not_lose_the_mesh(make, server, client, tmp_path):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)

    def fill(progress):  # once there is a server, which is not to have this limit
        resource.setrlimit(resource.RLIMIT_FSIZE, (2000, limits[1]))

    options = {"on_progress": fill, "to": tmp_path / "a.vtu"}
    try:
        with pytest.raises(stellate.SaveError, match="too large.*the exception's") as private:
            stellate.mesh(make(), 0.3, **options)
        with pytest.raises(stellate.SaveError, match="too large.*on its server as meshes/") as here:
            stellate.mesh(make(), 0.3, server=server, **options)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert not list(tmp_path.iterdir())
    name = str(here.value).split()[-1]
    mesh = stellate.download(name, server=client)
    client.delete(name)
    assert mesh.certified and private.value.mesh.certified


@pytest.fixture
def interrupted(monkeypatch):
    """An event: SIGINT has been passed on to the server."""
    passed_on, interrupt = threading.Event(), _run.Run.interrupt

    def noted(self):
        interrupt(self)
        passed_on.set()

    monkeypatch.setattr(_run.Run, "interrupt", noted)
    return passed_on


def test_ctrl_c_cancels_it_and_gives_what_there_is(server, client, interrupted, tmp_path):
    before = {info.name for info in client.list()}

    class Striking(manifolds.Torus):
        asked = 0

        def closest_point(self, x):
            self.asked += len(x)
            if self.asked > 500 and not interrupted.is_set():
                os.kill(os.getpid(), signal.SIGINT)
                assert interrupted.wait(300)
            return super().closest_point(x)

    with pytest.raises(stellate.Interrupted, match="cancelled") as caught:
        stellate.mesh(Striking(), 0.02, server=server, to=tmp_path / "a.vtu")
    assert isinstance(caught.value.mesh, stellate.Mesh)
    assert not list(tmp_path.iterdir())
    assert {info.name for info in client.list()} <= before


def test_ctrl_c_while_the_file_is_written_waits_for_it(server, interrupted, monkeypatch, tmp_path):
    real = _run.stream

    def stream(*arguments, **more):
        os.kill(os.getpid(), signal.SIGINT)
        assert interrupted.wait(300)
        return real(*arguments, **more)

    monkeypatch.setattr(_run, "stream", stream)
    with pytest.raises(stellate.Interrupted, match="was finished, and is in .*a.vtu"):
        stellate.mesh(manifolds.Torus(), 0.3, server=server, to=tmp_path / "a.vtu")
    assert [path.name for path in tmp_path.iterdir()] == ["a.vtu"]


def test_an_oracle_that_raises_leaves_no_file(server, tmp_path):
    class Tired(manifolds.Torus):
        asked = 0

        def closest_point(self, x):
            self.asked += len(x)
            if self.asked > 100:
                raise KeyError("tired")
            return super().closest_point(x)

    with pytest.raises(KeyError, match="tired"):
        stellate.mesh(Tired(), 0.1, server=server, to=pathlib.Path(tmp_path) / "a.vtu")
    assert not list(tmp_path.iterdir())
