"""The Python client under `stellate conform`, whose help says what each line wants."""

from __future__ import annotations

import pathlib
import sys
import time
from typing import Any

import numpy as np
import stellate
from stellate import manifolds


class Circle:
    dimension = 1

    def __init__(self, ambient_dimension: int) -> None:
        self.ambient_dimension = ambient_dimension

    def closest_point(self, x):
        p = np.zeros_like(x)
        p[:, :2] = x[:, :2] / np.hypot(x[:, 0], x[:, 1])[:, None]
        return p

    def tangent_basis(self, p):
        bases = np.zeros((*p.shape, 1))
        bases[:, 0, 0], bases[:, 1, 0] = -p[:, 1], p[:, 0]
        return bases


class Sphere(manifolds.Sphere):
    def __init__(self) -> None:
        super().__init__(2)

    def local_size(self, p):
        return 1 + p[:, 2] / 2

    def intersect_flat(self, c, bases, radii):
        along = np.cross(bases[:, :, 0], bases[:, :, 1])
        middle = -(c * along).sum(axis=1)
        half = np.sqrt(np.maximum(middle**2 - (c * c).sum(axis=1) + 1, 0))
        step = np.where(middle > 0, middle - half, middle + half)
        points = c + step[:, None] * along
        return points, (half > 0) & (np.abs(step) <= radii)


class Lune(manifolds.Sphere):
    """The part of the sphere where z >= 0 and y >= 0."""

    walls, local_size = 2, None

    def __init__(self) -> None:
        super().__init__(2)

    @staticmethod
    def normals(face):
        return np.eye(3)[[2 - wall for wall in face]]

    def face_point(self, x, face):
        flat = x * (1 - self.normals(face).sum(axis=0))
        found = flat.any(axis=1)
        flat[~found] = np.nan
        points = flat / np.sqrt((flat * flat).sum(axis=1))[:, None]
        if not found.all():
            raise stellate.NotConverged(points, found)
        return points

    def clearances(self, p):
        return p[:, [2, 1]]

    def conormals(self, p, face):
        return np.broadcast_to(-self.normals(face), (len(p), len(face), 3))


class Half(manifolds.Torus):
    def closest_point(self, x):
        found = x[:, 0] >= 0
        if not found.all():
            raise stellate.NotConverged(super().closest_point(x), found)
        return super().closest_point(x)


class Raises(manifolds.Torus):
    def closest_point(self, x):
        raise RuntimeError("on purpose")


class Slow(manifolds.Torus):
    def closest_point(self, x):
        time.sleep(2)
        return super().closest_point(x)


def named(name: str) -> Any:
    if name.startswith("circle:"):
        oracle = Circle(int(name.removeprefix("circle:")))
    elif name == "clifford":
        oracle = manifolds.ProductOfCircles()
    else:
        kinds = {"torus": manifolds.Torus, "so3": manifolds.SpecialOrthogonal3}
        kinds |= {"sphere": Sphere, "lune": Lune, "half": Half, "raises": Raises, "slow": Slow}
        oracle = kinds[name]()
    if not hasattr(oracle, "bounding_box"):
        d = oracle.ambient_dimension
        oracle.bounding_box = -np.full(d, 1.5), np.full(d, 1.5)
    if hasattr(oracle, "local_size") and name != "sphere":
        oracle.local_size = None
    return oracle


def serve(client: stellate.Client, mesh: str, manifold: str) -> str:
    try:
        return f"over {client.serve(named(manifold), mesh)}"
    except RuntimeError as error:
        return f"error oracle RAISED {error}"


def watch(client: stellate.Client, mesh: str, path: str, *dimensions: str) -> str:
    try:
        *_, last = stellate.watch(mesh, server=client)
    except stellate.Cancelled as stopped:
        last = stopped.mesh
    last.save(path)
    if last.walls is not None:
        pathlib.Path(f"{path}.walls").write_text("".join(f"{bits}\n" for bits in last.walls))
    level = last.report.certificate.level
    return f"mesh {last.revision} {last.report.termination} {level}"


def create(client: stellate.Client, label: str, how: str = "") -> str:
    torus = named("lune") if how == "walls" else manifolds.Torus()
    if how == "seeds":
        torus.seeds, torus.bounding_box = np.array([[1.4, 0.0, 0.0]]), None
    if how.startswith("token="):
        credentials = stellate.Credentials(how.removeprefix("token="))
        with stellate.Client(client.address, credentials) as known:
            return f"created {known.create(torus, 0.5, label=label).name}"
    return f"created {client.create(torus, 0.5, label=label).name}"


def reconstruct(client: stellate.Client, path: str, dimension: str, _ambient: str) -> str:
    rows = [
        [float(x) for x in line.split()] for line in pathlib.Path(path).read_text().splitlines()
    ]
    mesh = stellate.reconstruct(rows, int(dimension), server=client)
    return f"mesh - {mesh.report.termination} {mesh.report.certificate.level}"


def save(client: stellate.Client, mesh: str, path: str) -> str:
    stellate.load_txt(pathlib.Path(mesh)).save(path)
    return "saved"


def main() -> None:
    with stellate.Client(sys.argv[1]) as client:
        for line in sys.stdin:
            command, *rest = line.split()
            does = {
                "serve": serve, "watch": watch, "create": create, "reconstruct": reconstruct,
                "save": save,
            }[command]  # fmt: skip
            try:
                answer = does(client, *rest)
            except stellate.StellateError as error:
                words = " ".join(str(error).split())
                answer = f"error {type(error).__name__} {error.reason} {words}"
            print(answer, flush=True)


if __name__ == "__main__":
    main()
