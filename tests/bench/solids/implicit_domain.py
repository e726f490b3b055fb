"""Solids beside `mesh_implicit_domain` of NVIDIA's PhysicsNeMo: prints a table, asserts nothing.

    STELLATED=... PYTHONPATH=clients/python python3 tests/bench/solids/implicit_domain.py [SCALE]

Wants the package `nvidia-physicsnemo`, in an environment of its own with what this client takes; no GPU. It is
given the formula, negative inside, and a length h that makes about as many vertices as Stellate's epsilon does;
*pinned* to the vertices of Stellate's creases, too. Seconds are of the clock, one thread each.
  walls, middles   the farthest that a vertex and a triangle's middle of the boundary is from f = 0
  edges            the farthest that a vertex of a true edge is from the mesh's boundary; all as shares of epsilon
  angle            the least dihedral angle, degrees
"""

import itertools
import sys
import time

import numpy as np
import stellate
import torch
from physicsnemo.mesh.generate import mesh_implicit_domain
from scipy.spatial import cKDTree
from stellate import solids as s

torch.set_num_threads(1)
_SAMPLES = np.random.default_rng(1).dirichlet([1, 1, 1], 40)


def ball(r, at=(0.0, 0.0, 0.0)):
    return lambda x: (x - torch.tensor(at, dtype=x.dtype)).norm(dim=-1) - r


def box(half):
    def phi(x):
        q = x.abs() - half
        return q.clamp(min=0).norm(dim=-1) + q.max(dim=-1).values.clamp(max=0)

    return phi


def tube(r):
    return lambda x: x[:, 1:].norm(dim=-1) - r


def ring(major, minor):
    return lambda x: torch.hypot(x[:, :2].norm(dim=-1) - major, x[:, 2]) - minor


def gyroid(x):
    g = sum(torch.sin(3 * x[:, i]) * torch.cos(3 * x[:, (i + 1) % 3]) for i in range(3))
    return g / 4.5


def _g(x):
    return -sum(np.sin(3 * x[:, i]) * np.cos(3 * x[:, (i + 1) % 3]) for i in range(3)) / 4.5


def most(*parts):
    return lambda x: torch.stack([p(x) for p in parts]).max(dim=0).values


def least(*parts):
    return lambda x: torch.stack([p(x) for p in parts]).min(dim=0).values


def minus(part):
    return lambda x: -part(x)


def octahedron(x):
    return (x.abs().sum(dim=-1) - 1) / 3**0.5


_LENS = float(np.cos(np.radians(20)))
_SIGNS = list(itertools.product((-1, 1), repeat=3))
_OCTAHEDRON = s.Box([-1.2] * 3, [1.2] * 3)
for _sign in _SIGNS:
    _OCTAHEDRON = _OCTAHEDRON & s.HalfSpace(_sign, -1)
_CUBE = s.Box([-1] * 3, [1] * 3)
SOLIDS = {
    "box minus ball": (_CUBE - s.Ball(0.9, at=(1, 1, 1)), most(box(1.0), minus(ball(0.9, (1.0, 1.0, 1.0)))), 0.2),
    "drilled block": (
        (_CUBE & s.Ball(1.3)) - s.Cylinder(0.5, axis="x"),
        most(box(1.0), ball(1.3), minus(tube(0.5))),
        0.16,
    ),
    "solid torus": (s.Torus(1, 0.4), ring(1.0, 0.4), 0.14),
    "two balls joined": (s.Ball(1) | s.Ball(1, at=(1, 0, 0)), least(ball(1.0), ball(1.0, (1.0, 0.0, 0.0))), 0.2),
    "cube and ball joined": (
        s.Box([-0.7] * 3, [0.7] * 3) | s.Ball(0.7, at=(0.5, 0.5, 0.5)),
        least(box(0.7), ball(0.7, (0.5, 0.5, 0.5))),
        0.14,
    ),
    "gyroid in a ball": (
        s.Ball(1.2) & s.Implicit(_g, bounding_box=([-1.5] * 3, [1.5] * 3)),
        most(ball(1.2), gyroid),
        0.12,
    ),
    "octahedron": (_OCTAHEDRON, octahedron, 0.14),
    "lens of 40 degrees": (
        s.Ball(1, at=(0, 0, _LENS)) & s.Ball(1, at=(0, 0, -_LENS)),
        most(ball(1.0, (0.0, 0.0, _LENS)), ball(1.0, (0.0, 0.0, -_LENS))),
        0.06,
    ),
}  # fmt: skip


def boundary(cells):
    faces = np.sort(np.concatenate([np.delete(cells, i, axis=1) for i in range(4)]), axis=1)
    rows, counts = np.unique(faces, axis=0, return_counts=True)
    return rows[counts == 1]


def euler(cells):
    chi = 0
    for size in range(1, 5):
        rows = [np.sort(cells[:, list(c)], axis=1) for c in itertools.combinations(range(4), size)]
        chi += (-1) ** (size - 1) * len(np.unique(np.concatenate(rows), axis=0))
    return chi


def dihedral(corners):
    least_angle = 180.0
    for i, j in itertools.combinations(range(4), 2):
        k, m = (n for n in range(4) if n not in (i, j))
        along = corners[:, j] - corners[:, i]
        along /= np.linalg.norm(along, axis=1)[:, None]
        sides = []
        for n in (k, m):
            v = corners[:, n] - corners[:, i]
            v = v - (v * along).sum(axis=1)[:, None] * along
            sides.append(v / np.maximum(np.linalg.norm(v, axis=1), 1e-300)[:, None])
        cosines = (sides[0] * sides[1]).sum(axis=1)
        least_angle = min(least_angle, float(np.degrees(np.arccos(np.clip(cosines.max(), -1, 1)))))
    return least_angle


def line(name, mesher, phi, points, cells, edges, seconds, epsilon, note=""):
    rim = boundary(cells)

    def off(x):
        y = torch.tensor(np.ascontiguousarray(x)).requires_grad_(True)
        f = phi(y)
        (g,) = torch.autograd.grad(f.sum(), y)
        return float((f.abs() / g.norm(dim=-1).clamp(min=0.1)).detach().max()) / epsilon

    apart = 0.0
    if len(edges):
        some = np.concatenate([(_SAMPLES @ points[rim]).reshape(-1, 3), points[np.unique(rim)]])
        apart = cKDTree(some).query(edges)[0].max() / epsilon
    print(
        f"{name:22s} {mesher:9s} {len(points):7d} {seconds:7.2f} {off(points[np.unique(rim)]):9.1e} "
        f"{off(points[rim].mean(axis=1)):8.3f} {apart:7.3f} {dihedral(points[cells]):6.1f} {euler(cells):4d}  {note}",
        flush=True,
    )


def nvidia(phi, lower, upper, h, pinned):
    began = time.monotonic()
    mesh = mesh_implicit_domain(
        phi,
        (lower.tolist(), upper.tolist()),
        h,
        feature_points=torch.tensor(pinned) if len(pinned) else None,
        max_coverage_gap_h=None,
        device="cpu",
    )
    return mesh.points.numpy(), mesh.cells.numpy(), time.monotonic() - began


def main() -> None:
    scale = float(sys.argv[1]) if len(sys.argv) > 1 else 1.0
    print(f"{'solid':22s} {'mesher':9s} vertices seconds     walls  middles   edges  angle  chi")
    with stellate.Server() as server:
        for name, (solid, phi, epsilon) in SOLIDS.items():
            epsilon *= scale
            began = time.monotonic()
            mesh = stellate.mesh(solid, epsilon, server=server)
            seconds = time.monotonic() - began
            kept = [mesh.points[np.unique(edge.simplices)] for edge in mesh.edges]
            edges = np.concatenate(kept) if kept else np.empty((0, 3))
            note = "certified" if mesh.certified else "NOT CERTIFIED"
            line(name, "Stellate", phi, mesh.points, mesh.simplices, edges, seconds, epsilon, note)
            lower, upper = mesh.points.min(axis=0) - 0.1, mesh.points.max(axis=0) + 0.1
            h = float((np.prod(upper - lower) / len(mesh.points)) ** (1 / 3)) * 0.8
            for pinned in [np.empty((0, 3)), edges] if len(edges) else [edges]:
                try:
                    for _ in range(3):  # to as many vertices
                        points, cells, seconds = nvidia(phi, lower, upper, h, pinned)
                        ratio = len(points) / len(mesh.points)
                        if 0.8 < ratio < 1.25:
                            break
                        h *= ratio ** (1 / 3)
                    line(
                        name,
                        "pinned" if len(pinned) else "NVIDIA",
                        phi,
                        points,
                        cells,
                        edges,
                        seconds,
                        epsilon,
                        f"h {h:.3f}",
                    )
                except (ValueError, RuntimeError) as error:
                    print(
                        f"{name:22s} {'pinned' if len(pinned) else 'NVIDIA':9s} {type(error).__name__}: {str(error)[:140]}"
                    )


if __name__ == "__main__":
    main()
