"""Manifolds meshed through the real server: certified, and right by an independent check."""

import numpy as np
import pytest
import stellate
import topology
from stellate import manifolds


def projective_plane():
    """RP^2 in R^6: the symmetric 3 x 3 projections on lines (Veronese), by eigenvectors."""

    rows, columns = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
    scale = np.array([1, 1, 1, 2**0.5, 2**0.5, 2**0.5])  # so that the norm is the matrix's

    class Veronese:
        dimension, ambient_dimension = 2, 6
        bounding_box = np.full(6, -1.1), np.full(6, 1.1)

        def frame(self, x):
            matrices = np.zeros((len(x), 3, 3))
            matrices[:, rows, columns] = matrices[:, columns, rows] = x / scale
            return np.linalg.eigh(matrices)[1]  # the line last, its normal plane before

        def closest_point(self, x):
            line = self.frame(x)[:, :, 2]
            return line[:, rows] * line[:, columns] * scale

        def tangent_basis(self, x):
            frame = self.frame(x)
            line, plane = frame[:, :, 2:], frame[:, :, :2]
            turned = line[:, rows] * plane[:, columns] + plane[:, rows] * line[:, columns]
            return turned * scale[:, None] / 2**0.5

    return Veronese()


def implicit_clifford():
    """x^2 + y^2 = 1, z^2 + w^2 = 1: codimension two, with a difference Jacobian."""

    def f(x):
        squares = x * x
        return np.stack([squares[:, 0] + squares[:, 1], squares[:, 2] + squares[:, 3]], axis=1) - 1

    box = np.full(4, -1.2), np.full(4, 1.2)
    return stellate.ImplicitManifold(f, ambient_dimension=4, dimension=2, bounding_box=box)


def implicit_torus():
    """In space by its equation: with tangents and flats of its own."""

    def f(x):
        ring = np.sqrt(x[:, 0] ** 2 + x[:, 1] ** 2)
        return ((ring - 1) ** 2 + x[:, 2] ** 2 - 0.16)[:, None]

    box = manifolds.Torus().bounding_box
    return stellate.ImplicitManifold(f, ambient_dimension=3, dimension=2, bounding_box=box)


# Of each kind of Python oracle one; what the server makes of every kind of manifold: ../manifolds_test.cc.
# name: (oracle, epsilon, Euler characteristic, Betti numbers over Z/2, orientable)
MANIFOLDS = {
    "torus": (manifolds.Torus(), 0.1, 0, [1, 2, 1], True),
    "implicit torus": (implicit_torus(), 0.15, 0, [1, 2, 1], True),
    "tanglecube": (manifolds.tanglecube(), 0.12, -8, [1, 10, 1], True),
    "implicit Clifford torus": (implicit_clifford(), 0.35, 0, [1, 2, 1], True),
    "RP^2 in R^6": (projective_plane(), 0.15, 1, [1, 1, 1], False),
    "SO(3) in R^9": (manifolds.SpecialOrthogonal3(), 0.45, 0, [1, 1, 1, 1], True),
}


@pytest.mark.parametrize("name", MANIFOLDS)
def test_manifold(name, server):
    oracle, epsilon, euler, betti, orientable = MANIFOLDS[name]
    mesh = stellate.mesh(oracle, epsilon, server=server)
    certificate = mesh.report.certificate
    assert mesh.report.termination == "CONVERGED"
    assert mesh.certified, mesh.report
    assert certificate.closed and certificate.links_are_spheres
    assert certificate.components == 1
    assert certificate.euler_characteristic == euler
    assert certificate.orientable == orientable
    assert certificate.max_circumradius <= epsilon * (1 + 1e-9)
    counts = mesh.report.counts
    assert (counts.vertices, counts.simplices) == (len(mesh.points), len(mesh.simplices))
    topology.assert_closed_manifold(mesh, euler, betti)
    assert (mesh.oriented_simplices() is not None) == orientable
    on_manifold = oracle.closest_point(mesh.points)
    assert np.abs(on_manifold - mesh.points).max() < 1e-9


def test_components_are_all_found_from_one_seed_each(server):
    class TwoSpheres:
        dimension, ambient_dimension = 2, 3
        centres = np.array([[-2.0, 0, 0], [2.0, 0.3, 0]])
        seeds = np.array([[-1.0, 0, 0], [2.0, 0.3, 1.0]])

        def closest_point(self, x):
            centre = self.centres[(x[:, 0] > 0).astype(int)]
            away = x - centre
            return centre + away / np.sqrt((away * away).sum(axis=1, keepdims=True))

    mesh = stellate.mesh(TwoSpheres(), 0.25, server=server)
    assert mesh.certified, mesh.report
    assert mesh.report.certificate.components == topology.component_count(mesh.simplices) == 2
    topology.assert_closed_manifold(mesh, 4, [2, 0, 2])


@pytest.mark.parametrize("epsilon", [0.6, 1.0, 1.5, 3.0])
def test_epsilon_far_above_the_reach_is_told_and_never_certified_wrongly(epsilon, server):
    """The reach is 0.4. Above 0.8 of it no mesh is certified, and the report says so."""
    mesh = stellate.mesh(manifolds.Torus(), epsilon, server=server)
    if mesh.report.termination == "CONVERGED":
        assert mesh.report.certificate.epsilon_over_reach > 1
    assert not mesh.certified


def test_what_is_declared_and_asked_for_is_compared_with_the_mesh(server):
    plain = stellate.mesh(manifolds.Torus(), 0.2, server=server)
    assert "no boundary" in plain.report.certificate.verdict
    two = stellate.mesh(manifolds.Torus(), 0.2, server=server, components=2)
    assert not two.certified
    assert "2 were declared" in two.report.certificate.verdict
    assert np.array_equal(two.points, plain.points)
    thorough = stellate.mesh(manifolds.Torus(), 0.2, server=server, components=1, audit="thorough")
    assert thorough.certified, thorough.report
    assert "balls at every vertex and simplex" in thorough.report.certificate.verdict
    assert thorough.report.counts.queries > plain.report.counts.queries
    assert np.array_equal(thorough.points, plain.points)
    with pytest.raises(stellate.InvalidArgument, match="audit"):
        stellate.mesh(manifolds.Torus(), 0.2, server=server, audit="deep")


@pytest.mark.parametrize(
    "limit, end", [("max_vertices", "VERTEX_BUDGET"), ("max_rounds", "ROUND_BUDGET")]
)
def test_a_budget_that_is_spent_leaves_an_uncertified_mesh(limit, end, server):
    mesh = stellate.mesh(manifolds.Torus(), 0.05, server=server, **{limit: 8})
    assert mesh.report.termination == end
    assert not mesh.certified
    assert limit in str(mesh.report)
    certificate = mesh.report.certificate
    at_fault = certificate.violations.inconsistent
    assert len(at_fault) <= certificate.inconsistent_simplices
    assert bool(at_fault) == (certificate.inconsistent_simplices > 0) == (limit == "max_rounds")
    assert list(at_fault) == sorted(set(at_fault))
    assert all(vertex < mesh.report.counts.vertices for vertex in at_fault)


def test_a_mesh_that_has_to_be_certified(server):
    torus = stellate.manifolds.Torus()
    with pytest.raises(stellate.NotCertified, match="VERTEX_BUDGET") as caught:
        stellate.mesh(torus, 0.2, server, max_vertices=60, require_certified=True)
    assert caught.value.mesh.report.termination == "VERTEX_BUDGET"
    assert caught.value.mesh.report.epsilon == 0.2
    assert stellate.mesh(torus, 0.2, server, require_certified=True).certified


def test_a_mesh_is_saved_where_it_was_asked(server, tmp_path):
    files = [tmp_path / "torus.stl", tmp_path / "torus.msh"]
    stellate.mesh(manifolds.Torus(), 0.3, server, save=files)
    assert all(file.stat().st_size > 1000 for file in files)


def test_what_cannot_be_saved_is_refused_before_meshing(tmp_path):
    def never(progress):
        raise AssertionError("it is being meshed")

    for name in ("so3.stl", "so3.msh", "so3.wkt"):
        with pytest.raises(stellate.SaveError):
            stellate.mesh(
                manifolds.SpecialOrthogonal3(), 0.4, "unix:/nowhere", never, save=tmp_path / name
            )
    with pytest.raises(FileNotFoundError):
        stellate.mesh(manifolds.Torus(), 0.3, "unix:/nowhere", save=tmp_path / "no" / "such.txt")


def test_a_mesh_of_points_alone_is_saved_or_refused_in_words(tmp_path):
    points = np.eye(3)
    bare = stellate.Mesh(points, np.empty((0, 3), dtype=np.uint32))
    for name in ("bare.txt", "bare.msh", "bare.vtu"):
        bare.save(tmp_path / name)
        assert (tmp_path / name).stat().st_size > 0
    with pytest.raises(stellate.SaveError, match="no simplices.*[.]vtu"):
        bare.save(tmp_path / "bare.vtk")
    assert not list(tmp_path.glob("*.vtk"))


def test_a_mesh_that_could_not_be_written_is_the_exceptions(server, tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()

    def remove(progress):
        if folder.exists():
            folder.rmdir()

    with pytest.raises(stellate.SaveError, match="No such file") as lost:
        stellate.mesh(manifolds.Torus(), 0.3, server, remove, save=folder / "torus.txt")
    assert lost.value.mesh.certified


def test_the_verdict_names_the_bandwidth_of_a_cloud(server):
    rng = np.random.default_rng(1)
    points = rng.normal(size=(4000, 3))
    points *= rng.normal(1, 0.003, (4000, 1)) / np.linalg.norm(points, axis=1, keepdims=True)
    cloud = stellate.oracles.PointCloud(points, 2)
    report = stellate.mesh(cloud, 0.4, server=server).report
    assert report.certified and f"bandwidth {cloud.bandwidth:.3g} (" in repr(cloud)
    assert report.certificate.verdict.endswith(f". The oracle says of itself: {cloud!r}.")
    assert repr(cloud) in " ".join(str(report).split())


def test_what_an_oracle_says_of_itself_changes_no_mesh(server):
    silent, told = manifolds.Sphere(2), manifolds.Sphere(2)
    told.about = "Of radius 1, as it says itself."
    plain, other = (stellate.mesh(oracle, 0.5, server=server) for oracle in (silent, told))
    assert np.array_equal(plain.points, other.points)
    assert np.array_equal(plain.simplices, other.simplices)
    verdict = plain.report.certificate.verdict
    words = f" The oracle says of itself: {told.about}"
    assert other.report.certificate.verdict == verdict.removesuffix(".") + "." + words
    box = ([-1.2] * 3, [1.2] * 3)
    with stellate.pulling.pull(2, 3, 0.5, server, bounding_box=box, about=told.about) as puller:
        for chunk in puller:
            chunk.answer(told.closest_point(chunk.points))
    assert puller.mesh.report.certificate.verdict.endswith(words)
    coarse = stellate.mesh(told, 5, server=server).report
    assert not coarse.certified and coarse.certificate.verdict.endswith(words)


def test_a_parametrization_that_ends_is_told_where_and_what_to_do(server):
    def helix(u):
        return np.stack([np.cos(u[:, 0]), np.sin(u[:, 0]), u[:, 0] / 5], axis=1)

    open_ends = stellate.oracles.Parametrized(helix, None, [0], [4 * np.pi])
    report = stellate.mesh(open_ends, 0.1, server=server).report
    assert report.termination == "NO_PROGRESS"
    verdict = report.certificate.verdict
    assert verdict.startswith(
        "not certified: the manifold ends where the map does, at the lower end 0"
    )
    assert "oracles.Clipped(parametrized, [wall])" in verdict and "epsilon" not in verdict
    told = dict(report.lines())  # the words for people are as the server's, but for that
    assert f"not certified: {' '.join(told['certificate'][15:].split())}" == verdict
    assert list(told)[:5] == ["mesh", "run", "took", "inserted for", "certificate"]
    assert max(map(len, str(report).splitlines())) <= 100
