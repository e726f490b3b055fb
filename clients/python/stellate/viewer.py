"""Meshes in a browser: the page of `stellate view`, filled or followed from here."""

from __future__ import annotations

import base64
import contextlib
import html
import json
import os
import pathlib
import shutil
import signal
import subprocess
import tempfile
import webbrowser
from typing import TYPE_CHECKING, Any

import numpy as np

from ._credentials import Credentials
from ._generated import geometry_pb2 as geometry
from ._generated import mesh_pb2 as pb
from ._generated import stellate_pb2 as calls
from ._wire import arrays, enums
from .errors import Unavailable, ViewerNotFound
from .report import Report
from .server import Server, find_stellated

if TYPE_CHECKING:
    from ._mesh import Mesh

__all__ = ["LiveView"]

_PLACE = 'id="recording">'  # where the page keeps its recording
_STATES = {
    "CONVERGED": pb.MESH_STATE_SUCCEEDED,
    "CANCELLED": pb.MESH_STATE_CANCELLED,
    "ORACLE_FAILED": pb.MESH_STATE_FAILED,
}
_STOP_SECONDS = 5.0


def find_stellate() -> str:
    """The command line: $STELLATE, else beside the server that would be started, else on PATH.

    Raises: ViewerNotFound.
    """
    named = os.environ.get("STELLATE")
    beside = None
    with contextlib.suppress(FileNotFoundError):
        beside = str(pathlib.Path(find_stellated()).with_name("stellate"))
    for candidate in (named,) if named else (beside, "stellate"):
        path = candidate and shutil.which(candidate)
        if path:
            return path
    raise ViewerNotFound(
        "the viewer is part of the command line `stellate`, which was not found: set $STELLATE to "
        "it, or put it on PATH; clients/quickstart --all builds it"
    )


def _page() -> str:
    told = subprocess.run([find_stellate(), "view", "--page"], capture_output=True, text=True)
    if told.returncode != 0:
        raise ViewerNotFound(told.stderr.strip().removeprefix("stellate: "))
    return told.stdout


def _indices(array: np.ndarray) -> geometry.IndexArray:
    return geometry.IndexArray(shape=array.shape, data=array.astype("<u4").tobytes())


def _report(report: Report) -> pb.Report:
    message = pb.Report(elapsed_seconds=report.elapsed_seconds)
    message.termination = pb.Termination.Value(f"TERMINATION_{report.termination}")  # type: ignore[assignment]
    if report.failure is not None:
        message.failure.reason = report.failure.reason
        message.failure.message = report.failure.message
    fields = {f.name for f in pb.Counts.DESCRIPTOR.fields}
    message.counts.MergeFrom(
        pb.Counts(**{k: v for k, v in vars(report.counts).items() if k in fields})
    )
    certificate = dict(vars(report.certificate))
    level = f"CERTIFICATE_LEVEL_{certificate.pop('level')}"
    certificate["level"] = dict(pb.CertificateLevel.items()).get(level, 0)
    violations = certificate.pop("violations")
    fields = {f.name for f in pb.Certificate.DESCRIPTOR.fields}
    message.certificate.MergeFrom(
        pb.Certificate(**{k: v for k, v in certificate.items() if k in fields})
    )
    for kind, ids in vars(violations).items():
        if ids:
            getattr(message.certificate.violations, kind).CopyFrom(_indices(np.array(ids)))
    return message


def _status(mesh: Mesh, label: str) -> pb.Mesh:
    status = pb.Mesh(name="meshes/here", revision=1)
    status.spec.dimension = mesh.dimension
    status.spec.ambient_dimension = mesh.ambient_dimension
    status.spec.label = label
    status.spec.scale.extend(mesh.scale)
    status.progress.vertices = len(mesh.points)
    status.progress.simplices = len(mesh.simplices)
    status.state = pb.MESH_STATE_RUNNING
    if mesh.report is not None:
        status.state = _STATES.get(mesh.report.termination, pb.MESH_STATE_STOPPED)
        status.spec.epsilon = mesh.report.epsilon or mesh.report.certificate.max_circumradius
        status.report.CopyFrom(_report(mesh.report))
        status.end_time.seconds = 1  # it is over; when does not matter
        counts = mesh.report.counts
        status.progress.queries, status.progress.round = counts.queries, counts.rounds
        status.progress.elapsed_seconds = mesh.report.elapsed_seconds
    return status


def _download(mesh: Mesh, status: pb.Mesh) -> calls.DownloadMeshResponse:
    """What became of the points of a reconstruction, which a download has alone."""
    status.spec.reconstruction.points = len(mesh.points)
    code_of = {enums.place(number): number for number in pb.Place.values()}
    codes = [code_of[name] for name in np.asarray(mesh.places).tolist()]
    for code in np.unique(codes).tolist():
        status.report.reconstruction.places.add(place=code, points=codes.count(code))
    return calls.DownloadMeshResponse(
        revision=status.revision,
        vertices=len(codes),
        simplices=len(mesh.simplices),
        places=pb.Places(codes=bytes(codes)),
        complete=True,
    )


def page_of(mesh: Mesh, label: str = "") -> str:
    """The viewer's page with this mesh in it, whole: HTML that needs no server and no network."""
    status = _status(mesh, label)
    delta = pb.MeshDelta(
        revision=status.revision,
        points=arrays.to_wire(np.asarray(mesh.points, dtype=float)),
        added=_indices(np.sort(mesh.simplices, axis=1)),
    )
    if mesh.walls is not None:
        status.spec.walls = int(np.bitwise_or.reduce(mesh.walls)).bit_length()
        (ends,) = np.nonzero(mesh.walls)
        delta.boundary_vertices.extend(ends.tolist())
        delta.boundary_walls.extend(mesh.walls[ends].tolist())
    if mesh.labels is not None:
        delta.added_labels = mesh.labels.astype(np.uint8).tobytes()
        status.spec.labels = bytes(np.unique(mesh.labels).astype(np.uint8))
        if mesh.is_boundary:
            status.spec.boundary_only = True
            status.spec.dimension += 1  # the solid's
    grown = calls.WatchMeshResponse(delta=calls.DeltaChunk(delta=delta, complete=True))
    replies: dict[str, list[Any]] = {
        "WatchMesh": [grown, calls.WatchMeshResponse(final=status)],
        "GetMesh": [status],
    }
    if mesh.places is not None:
        replies["DownloadMesh"] = [_download(mesh, status)]
    recording = {
        "replies": [
            {
                "method": method,
                "frames": [base64.b64encode(m.SerializeToString()).decode() for m in messages],
            }
            for method, messages in replies.items()
        ]
    }
    before, place, after = _page().partition(_PLACE)
    return f"{before}{place}{json.dumps(recording)}{after}"


def _in_notebook() -> bool:
    try:
        from IPython import get_ipython
    except ImportError:
        return False
    return "IPKernelApp" in getattr(get_ipython(), "config", {})


class Frame:
    """A page in a notebook's output."""

    def __init__(self, page: str, height: int) -> None:
        self._page, self._height = page, height

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{html.escape(self._page)}" width="100%" height="{self._height}" '
            'style="border: 1px solid #ccc"></iframe>'
        )


def show(mesh: Mesh, path: str | os.PathLike[str] | None, label: str, height: int) -> Frame | None:
    """See Mesh.show."""
    page = page_of(mesh, label)
    if path is not None:
        pathlib.Path(path).write_text(page, encoding="utf-8")
        return None
    if _in_notebook():
        return Frame(page, height)
    with tempfile.NamedTemporaryFile(
        "w", prefix="stellate-", suffix=".html", delete=False, encoding="utf-8"
    ) as file:
        file.write(page)
    if not webbrowser.open(pathlib.Path(file.name).as_uri()):
        print(f"no browser was found to open {file.name}")
    return None


class LiveView:
    """Meshes of a server, live in a browser or a notebook's frame. A context manager.

    Attributes:
      url: where the page is, for this machine and this user alone.
    """

    def __init__(
        self,
        server: str | Server,
        mesh: str = "",
        *,
        credentials: Credentials | None = None,
        height: int = 640,
    ) -> None:
        """Starts `stellate view` for the server's meshes, `mesh` first, else the newest.

        In a notebook the value of the cell is the frame. Raises: ViewerNotFound, Unavailable.
        """
        self._height = height
        address = server.address if isinstance(server, Server) else server
        command = [find_stellate(), "view", *([mesh] if mesh else []), "--no-browser"]
        command += ["--server", address]
        environment = dict(os.environ)
        given = credentials or Credentials()
        if given.tls:
            command.append("--tls")
        for flag, path in (
            ("--tls-ca", given.ca),
            ("--tls-cert", given.certificate),
            ("--tls-key", given.key),
        ):
            if path is not None:
                command += [flag, os.fspath(path)]
        if given.token is not None:
            environment["STELLATE_TOKEN"] = given.token  # other users see a command, not this
        self._process = subprocess.Popen(
            command,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,  # an interrupt of the notebook is for the cell that runs
        )
        assert self._process.stdout is not None and self._process.stderr is not None
        self.url = self._process.stdout.readline().strip()
        if not self.url:
            why = self._process.stderr.read().strip().removeprefix("stellate: ")
            self.close()
            raise ViewerNotFound(why) if "viewer" in why else Unavailable(why)

    def close(self) -> None:
        """Ends it; the page stays as it is."""
        process = getattr(self, "_process", None)
        if process is None:
            return
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(_STOP_SECONDS)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        process.stdout.close()
        process.stderr.close()

    def _repr_html_(self) -> str:
        return (
            f'<iframe src="{html.escape(self.url)}" width="100%" height="{self._height}" '
            'style="border: 1px solid #ccc"></iframe>'
        )

    def __enter__(self) -> LiveView:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()
