"""Phases through the real server; labels, volumes and topology are counted here."""

import numpy as np
import pytest
import stellate
from stellate import oracles
from stellate import solids as s
from topology import component_count, euler_characteristic, is_closed


def near_to(centre):
    """Largest where the centre is the nearest: phases of such are the cells of their centres."""
    centre = np.asarray(centre, float)
    return lambda x: -((x - centre) ** 2).sum(axis=1)


def volume(points, simplices):
    corners = points[simplices]
    edges = corners[:, 1:] - corners[:, :1]
    d = points.shape[1]
    return np.abs(np.linalg.det(edges)).sum() / np.prod(np.arange(1, d + 1))


def hold(mesh, functions, total, slack):
    """Certified; each phase a ball, and of the volume that points thrown into the region tell."""
    assert mesh.certified, mesh.report
    labels = range(1, len(functions) + 1)
    assert set(mesh.labels.tolist()) == set(labels)
    middles = mesh.points[mesh.simplices].mean(axis=1)
    values = np.stack([f(middles) for f in functions], axis=1)
    off = values.max(axis=1) - values[np.arange(len(middles)), mesh.labels - 1]
    assert off.max() < slack  # only beside a curved wall, and less than it bends
    volumes = []
    for label in labels:
        part = mesh.simplices[mesh.labels == label]
        assert component_count(part) == 1 and euler_characteristic(part) == 1
        volumes.append(volume(mesh.points, part))
    assert sum(volumes) == pytest.approx(volume(mesh.points, mesh.simplices), rel=1e-12)
    assert sum(volumes) == pytest.approx(total, rel=0.08)  # chords of what is round


def test_three_phases_in_a_ball(server):
    functions = [near_to([np.cos(a), np.sin(a), 0.1 * a]) for a in (0.2, 2.3, 4.4)]
    phases = s.Phases(*functions) & s.Ball(1)
    mesh = stellate.mesh(phases, epsilon=0.2, server=server)
    hold(mesh, functions, 4 / 3 * np.pi, 1e-9)
    # The three meet along one edge, whose points are equally far from all centres.
    edges = [face for face in mesh.edges if set(face.walls) == {0, 1, 2}]
    assert len(edges) == 1
    values = np.stack([f(mesh.points[np.unique(edges[0].simplices)]) for f in functions])
    assert np.ptp(values, axis=0).max() < 1e-9
    regions = mesh.report.certificate.regions
    assert [(r.label, r.components, r.euler_characteristic) for r in regions] == [
        (label, 1, 1) for label in (1, 2, 3)
    ]
    labels = phases.label_at(mesh.points[mesh.simplices].mean(axis=1))
    assert (labels == mesh.labels).mean() > 0.99


def test_four_phases_that_bend_in_a_disc_and_in_a_ball(server):
    def bent(centre, by):
        plain = near_to(centre)
        return lambda x: plain(x) + by * np.cos(2 * x[:, 0])

    corners = [[1, 1, 1.1], [1, -1, -1], [-1, 1, -0.9], [-1, -1.1, 1]]
    functions = [bent(c, 0.2 * (i == 1)) for i, c in enumerate(corners)]
    mesh = stellate.mesh(s.Phases(*functions) & s.Ball(1), epsilon=0.3, server=server)
    hold(mesh, functions, 4 / 3 * np.pi, 0.1)
    flat = [near_to(c[:2]) for c in ([0.8, 0.1], [-0.3, 0.9], [-0.5, -0.6])]
    mesh = stellate.mesh(s.Phases(*flat) & s.Ball(1, at=(0, 0)), epsilon=0.15, server=server)
    hold(mesh, flat, np.pi, 1e-9)


@pytest.mark.parametrize("what", ["disc", "ball", "torus"])
def test_the_interfaces_of_three_phases_alone(server, what):
    """Each phase's surface is closed, and each triangle lies between the two that are the largest."""
    solid, epsilon, d = {
        "disc": (s.Ball(1, at=(0, 0)), 0.1, 2),
        "ball": (s.Ball(1), 0.2, 3),
        "torus": (s.Torus(1, 0.4), 0.13, 3),
    }[what]
    centres = [np.array([np.cos(a), np.sin(a), 0.1])[:d] for a in (0.2, 2.3, 4.4)]
    grains = [lambda x, c=c: -((x - c) ** 2).sum(axis=1) for c in centres]
    phases = s.Phases(*grains, names=["red", "green", "blue"]) & solid
    mesh = stellate.mesh(phases, epsilon, boundary_only=True, server=server)
    assert mesh.certified, mesh.report
    assert {tuple(sorted(pair)) for pair in mesh.labels.tolist()} == {
        (0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)
    }  # fmt: skip
    for name in ("red", "green", "blue"):
        surface = mesh.region(name)
        assert is_closed(surface.simplices)
        assert euler_characteristic(surface.simplices) == (0 if d == 2 else 2)
        assert surface.enclosed_volume > 0
    between = mesh.labels.min(axis=1) > 0
    middles = mesh.points[mesh.simplices[between]].mean(axis=1)
    heights = np.sort(np.stack([g(middles) for g in grains]), axis=0)
    assert (heights[2] - heights[1] < 0.05).all()
    largest = np.argsort(np.stack([g(middles) for g in grains]), axis=0)[1:] + 1
    assert (np.sort(largest, axis=0).T == np.sort(mesh.labels[between], axis=1)).mean() > 0.95


def test_closures_that_do_not_hold_are_refuted_by_name(server):
    f, g, h = (near_to([np.cos(a), np.sin(a)]) for a in (0.2, 2.3, 4.4))
    walls = [lambda x: f(x) - g(x), lambda x: f(x) - h(x) + 0.2, lambda x: g(x) - h(x)]
    labels = (s.Phases(f, g, h) & s.Ball(2, at=(0, 0))).labels[-8:]
    wrong = oracles.Solid(walls, ([-1] * 2, [1] * 2), labels=labels, closures=[(0, 1, 2)])
    with pytest.raises(stellate.StellateError, match="closures say|labels say"):
        stellate.mesh(wrong, epsilon=0.2, server=server)


def test_what_phases_refuse(server):
    f, g = near_to([1, 0, 0]), near_to([-1, 0, 0])
    with pytest.raises(stellate.InvalidArgument, match="go on without end: cut them by a solid"):
        stellate.mesh(s.Phases(f, g), epsilon=0.2, server=server)
    with pytest.raises(stellate.InvalidArgument, match="of two to six functions, and these are 1"):
        s.Phases(f)
    six = [near_to(np.eye(3)[i % 3] * (1 if i < 3 else -1)) for i in range(6)]
    with pytest.raises(stellate.InvalidArgument, match="there may be 16 together"):
        stellate.mesh(s.Phases(*six) & s.Box([-1] * 3, [1] * 3), epsilon=0.3, server=server)
    mesh = stellate.mesh(s.Ball(1) & s.Phases(f, g), epsilon=0.4, server=server)
    assert mesh.certified and set(mesh.labels.tolist()) == {1, 2}
