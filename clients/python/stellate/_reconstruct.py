"""stellate.reconstruct: points in, a mesh out."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import sys
import threading
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, Callable, Union

import numpy as np

from ._credentials import Credentials
from ._download import OnProgress, assemble
from ._files.formats import check_save
from ._info import MeshInfo, unless_failed
from ._interrupt import Interrupts
from ._mesh import FinishedMesh
from ._notebook import calm_output
from ._places import Places
from ._point_sets import column_names
from ._points import CheckedPoints, Noise, Weights
from ._upload import Upload
from .client import Client
from .errors import (
    FailedPrecondition,
    Interrupted,
    InvalidArgument,
    NotCertified,
    SaveError,
    StellateError,
    protocol_error,
)
from .oracles._units import about_units, units_of
from .progress import Patience, somebody_looks_on
from .report import Progress
from .server import Server

Path = Union[str, "os.PathLike[str]"]


def reconstruct(
    points: Any,
    dimension: int | None = None,
    tangents: Any = None,
    noise: Noise = "auto",
    reach: float | None = None,
    drop: float = 0.001,
    closed: bool = True,
    server: str | Server | Client | None = None,
    on_progress: OnProgress | None = None,
    *,
    weights: Weights = "auto",
    steiner: bool = False,
    scale: Any = None,
    credentials: Credentials | None = None,
    require_certified: bool = False,
    save: Path | Sequence[Path] = (),
    label: str | None = None,
    worker_wait_seconds: float | None = None,
    answer_seconds: float | None = None,
) -> FinishedMesh:
    """Makes a mesh of points on a manifold, or near it.

        mesh = stellate.reconstruct(points, dimension=2)
        print(mesh.report)

    Args:
      points: (n, d) finite numbers, an array, lists or a table, whose columns' names the mesh keeps. Row i is vertex i of the mesh: labels and other
        data of the points stay attached. None is moved, and none added unless by `steiner`.
      dimension: required, k of the manifold, 1 to 3, below d.
      tangents: (n, d, k), of each point a basis of the tangent space, its columns; they need not be
        orthonormal. None: they are estimated from the points.
      noise: how far points are off the manifold: the standard deviation of each coordinate, a length;
        0 says that they are on it, "auto" takes what the points show.
      reach: a promise: the manifold's reach is at least this length. Where the points are on it, the mesh
        may then be proved.
      drop: the share of the points that may be left out where all of them do not make a manifold and
        the others do, from 0 to 0.5.
      closed: False: the manifold may have a boundary, and the mesh ends where the points do.
      server: as for stellate.mesh; None starts one for this mesh.
      on_progress: called in this thread with a stellate.Progress now and then. If it raises, the mesh
        is cancelled.
      weights: "auto": stars that disagree are made to agree by tilings, and by weights of points where
        these do not do. "only": by weights alone, of any points: the mesh is their weighted tangential
        Delaunay complex, and is refused where stars disagree; `drop` and `steiner` are not used.
      steiner: vertices may be added where neither tilings nor weights make stars agree, nor leaving
        points out: at most one for each hundred points, or 16. They come after the points.
      scale: (d,) positive lengths, about how far the manifold goes along each axis, where axes have
        different units, or one for all: the complex is built in the coordinates x / scale. `noise`, `reach`
        and all lengths in the report are in these; points, tangents, places and the mesh are in x.
      credentials: a stellate.Credentials for `server`, where it wants TLS or a token.
      require_certified: a mesh that is not certified is an error, NotCertified.
      save: a file or several to write the mesh to, as for stellate.mesh.
      label: that lists and logs of the server show.
      worker_wait_seconds: for how long the server waits for points, should this program be away.
      answer_seconds: for how long an upload may send nothing.

    Returns:
      The mesh. Beside what every mesh has, `places` says what became of each point:

        OK        its star was right as it was built
        MERGED    equals an earlier point, which stands for it
        DROPPED   was left out
        TILED     stars disagreed around it, and a tiling of the place agrees
        WEIGHTED  has a weight, by which stars agree
        ADDED     is none of the points

      and of what is not resolved EDGE, SHEETS, NOISE, SPARSE, CLOSE or DISAGREE, the first that applies;
      `report.reconstruction` has their numbers, and what each is and what helps. `smoothed` are the
      positions that the complex was built on, where the points are noisy.

    Raises:
      InvalidArgument, naming the row where one is wrong; LimitExceeded, Unavailable, Cancelled,
      ServerNotFound, NotCertified; SaveError, which has the mesh; OSError. Ctrl-C cancels the mesh and is
      Interrupted.
    """
    limits = {"worker_wait_seconds": worker_wait_seconds, "answer_seconds": answer_seconds}
    checked = CheckedPoints(
        points, dimension, tangents, noise, reach, drop, closed, limits, label, weights, steiner
    )  # fmt: skip
    given = checked.points
    units = None if scale is None else units_of(scale, given.shape[1])
    if units is not None:
        checked.divide(units)
    files = [save] if isinstance(save, (str, os.PathLike)) else list(save)
    for file in files:
        check_save(file, checked.spec.dimension, checked.points.shape[1])
    if isinstance(server, Client) and credentials is not None:
        raise InvalidArgument("a Client has its credentials already: give it them")
    with contextlib.ExitStack() as stack:
        interrupts = stack.enter_context(Interrupts())
        if on_progress is None and somebody_looks_on(sys.stderr):
            on_progress = stack.enter_context(Patience(calm_output()))
        client = server
        if not isinstance(client, Client):
            client = stack.enter_context(Client(client, credentials))
        mesh = _run(client, checked, on_progress, interrupts)
    mesh = dataclasses.replace(mesh, coordinate_names=column_names(points))
    if units is not None:
        mesh = _in_own_coordinates(mesh, given, units)
    for file in files:
        try:
            mesh.save(file)
        except (OSError, SaveError) as error:
            raise SaveError(f"{error}; the mesh is the exception's", mesh=mesh) from error
    if require_certified and not mesh.certified:
        raise NotCertified(
            f"the mesh is not certified: {mesh.report.what_failed}; it is the exception's mesh",
            mesh=mesh,
        )
    return mesh


def _in_own_coordinates(mesh: FinishedMesh, given: np.ndarray, units: np.ndarray) -> FinishedMesh:
    """A mesh of the points given / units."""
    mesh = Places(SimpleNamespace(coordinates=lambda y: y * units)).in_mesh(mesh)
    points = mesh.points * units
    points[: len(given)] = given[: len(points)]  # to the last bit
    smoothed = None if mesh.smoothed is None else mesh.smoothed * units
    report = mesh.report.with_line("scale", about_units(units))
    return dataclasses.replace(
        mesh, points=points, smoothed=smoothed, report=report, scale=tuple(units.tolist())
    )


class _Sending(threading.Thread):
    """An upload, while this thread watches the mesh. `on_failure` is called where it fails."""

    def __init__(self, upload: Upload, on_failure: Callable[[], object]) -> None:
        super().__init__(name="upload", daemon=True)
        self._upload, self._on_failure = upload, on_failure
        self.error: BaseException | None = None

    def run(self) -> None:
        try:
            self._upload.run()
        except FailedPrecondition as error:
            self.error = error  # the mesh is over, and the watch says how it ended
        except BaseException as error:
            self.error = error
            self._on_failure()

    def stop(self) -> None:
        self._upload.stop()
        self.join()


def _run(
    client: Client, checked: CheckedPoints, on_progress: OnProgress | None, interrupts: Interrupts
) -> FinishedMesh:
    info = client.declare_points(checked)
    interrupted = threading.Event()

    def interrupt() -> None:
        interrupted.set()
        watch.close()

    watch = client.watch(info.name, progress_only=True)
    interrupts.on_first = interrupt
    sending = _Sending(client.upload(info.name, checked), watch.close)
    sending.start()
    try:
        final = None
        try:
            for event in watch:
                kind = event.WhichOneof("event")
                if kind == "progress" and on_progress is not None:
                    on_progress(Progress.from_wire(event.progress))
                elif kind == "final":
                    final = MeshInfo.from_wire(event.final)
        except StellateError:
            if sending.error is None and not interrupted.is_set():
                raise
        finally:
            watch.close()
        if interrupted.is_set():
            raise Interrupted("the reconstruction is cancelled")
        if final is None:
            sending.join()
            raise sending.error or protocol_error("it ended the watch too early")
        mesh = assemble(client, final, 0, None)
        unless_failed(mesh, final)
        if not isinstance(mesh, FinishedMesh):
            raise protocol_error("it ended the mesh without a report")
        return mesh
    finally:
        sending.stop()
        with contextlib.suppress(StellateError):  # it ends with its server
            client.delete(info.name, wait=False)
