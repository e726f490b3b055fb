"""stellate.mesh, stellate.watch, stellate.serve and stellate.download."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Literal, Union, overload

from ._checkpoint import Checkpoint
from ._credentials import Credentials
from ._download import Unfinished, fetch, fetch_to
from ._epsilon import Epsilon, what_is_missing
from ._files.formats import check_save
from ._findings import CheckReport
from ._follow import Following, OnProgress
from ._interrupt import Interrupts, told
from ._mesh import FinishedMesh, Mesh
from ._notebook import calm_output
from ._part_files import OnPart
from ._run import Run
from ._saved import SavedMesh
from .client import Client
from .errors import InvalidArgument, NotCertified, SaveError, protocol_error
from .options import MeshOptions, takes
from .oracle import CheckedOracle
from .oracles._kept import Keep
from .progress import Patience, somebody_looks_on
from .server import Server

if TYPE_CHECKING:
    from typing_extensions import Unpack

Path = Union[str, "os.PathLike[str]"]


def check(
    oracle: Any,
    epsilon: float | None = None,
    server: str | Server | Client | None = None,
    credentials: Credentials | None = None,
    *,
    seed: int = 1,
) -> CheckReport:
    """Probes an oracle: is it what stellate.Oracle says an oracle is?

    A server asks it, and says what it finds: finiteness and determinism; closest points that are
    closest, on M and met at right angles; the dimension; tangent bases; sizes; walls, where there are
    any; intersections with flats; smoothness; the reach and whether `epsilon` suits it; the components
    seen; speed. Of equations, whether they lose rank.

    Args:
      oracle: see stellate.Oracle.
      epsilon: that a mesh is planned with.
      server, credentials: as for stellate.mesh.
      seed: of the random queries.

    Returns:
      All that was found, `ok` if no error is among it. Exceptions of the oracle are findings too.
    """
    if isinstance(server, Client):
        return server.check(oracle, epsilon, seed=seed)
    with Client(server, credentials) as client:
        return client.check(oracle, epsilon, seed=seed)


@overload
def mesh(
    oracle: Any,
    epsilon: Epsilon,
    server: str | Server | Client | None = None,
    on_progress: OnProgress | None = None,
    credentials: Credentials | None = None,
    require_certified: bool = False,
    checkpoint: str | os.PathLike[str] | None = None,
    save: Path | Sequence[Path] | None = (),
    keep: Keep | None = None,
    scale: Any = None,
    keep_on_server: bool = False,
    **options: Unpack[MeshOptions],
) -> FinishedMesh: ...


@overload
def mesh(
    oracle: Any,
    epsilon: Epsilon,
    server: str | Server | Client | None = None,
    on_progress: OnProgress | None = None,
    credentials: Credentials | None = None,
    require_certified: bool = False,
    checkpoint: str | os.PathLike[str] | None = None,
    save: tuple[()] = (),
    keep: Keep | None = None,
    scale: Any = None,
    keep_on_server: bool = False,
    *,
    to: Path | Sequence[Path],
    **options: Unpack[MeshOptions],
) -> SavedMesh: ...


@takes(MeshOptions)
def mesh(
    oracle: Any,
    epsilon: Epsilon | None = None,
    server: str | Server | Client | None = None,
    on_progress: OnProgress | None = None,
    credentials: Credentials | None = None,
    require_certified: bool = False,
    checkpoint: str | os.PathLike[str] | None = None,
    save: Path | Sequence[Path] | None = (),
    keep: Keep | None = None,
    scale: Any = None,
    keep_on_server: bool = False,
    *,
    to: Path | Sequence[Path] = (),
    **options: Unpack[MeshOptions],
) -> FinishedMesh | SavedMesh:
    """Meshes the manifold that an oracle knows.

    Args:
      oracle: see stellate.Oracle.
      epsilon: required, the largest circumradius of a simplex, a length. The mesh lies within about
        epsilon^2 / (2 reach) of the manifold; 0.4 reach and below is safe. The number of vertices
        grows with epsilon^-k. "auto": a quarter of the reach that stellate.check finds, to two
        digits; where that was too coarse, twice at most, a quarter of what the certificate shows.
        `on_progress.note`, if there is one, and the report say what and why.
      server: "host:port", "unix:/path", a stellate.Server or Client; None starts a stellated on a
        private unix socket and stops it afterwards.
      on_progress: called in this thread with a stellate.Progress now and then. If it raises, the
        mesh is cancelled. With none, one line on a terminal or in a notebook says after 10 s that
        work goes on; `lambda progress: None` keeps that quiet, too.
      credentials: a stellate.Credentials for `server`, where it wants TLS or a token.
      require_certified: a mesh that is not certified is an error, NotCertified.
      checkpoint: a directory, made if it is not there, in which the mesh outlives this program: the
        same call goes on where it was interrupted or killed, the server died, or the oracle raised,
        and returns immediately when the mesh is finished.
      save: a file or several to write the mesh to, certified or not, as Mesh.save does. What their
        formats cannot hold is an error before anything is meshed.
      keep: "box": what lies in the oracle's bounding box, cut at its sides where the manifold leaves
        it; "seeds": the components that seeds lie on, and no other. What is meshed is
        oracles.kept(oracle, keep, seeds): workers that join have to serve that.
      scale: (d,) positive lengths, about how far the manifold goes along each axis, where axes have
        different units: M is meshed in the coordinates x / scale. `epsilon`, all other lengths and the
        report's are of these, sizes and angles, too; the oracle is asked, and points, places and
        seeds are, in its own coordinates. What is meshed is oracles.in_units(oracle, scale), which names
        the oracles that have one: workers that join have to serve that, and a server shows it.
      keep_on_server: a finished mesh stays on `server`, as the mesh's `name`, for stellate.download and
        viewers, until somebody deletes it or the server's `keep-finished-seconds`, an hour by default,
        are over, or its `keep-finished-meshes` newer ones are there.
      to: in place of `save`, a file or several that the finished mesh goes into as it comes from the
        server, so that this program never holds it, however large it is; see stellate.download for
        what is held whole still. So is a mesh with a `checkpoint`.
      **options: those below; one that is left out, or None, takes its default.

    Keyword Args:
      {options}

    Returns:
      The mesh; with `to` a SavedMesh, whose `points` and `cells` are mapped from the .vtu file. It may be
      uncertified, when a budget was spent or epsilon is too coarse: its report says so, and why;
      `require_certified` makes it an exception.

    Raises:
      What the oracle raises, as itself; OracleError for answers that break a rule, and for "auto"
      where stellate.check finds an error; TypeError for an option that there is not;
      InvalidArgument, LimitExceeded, Unavailable, Cancelled, ServerNotFound, NotCertified;
      SaveError, which has the mesh where there is one already, or with `to` says where a server of yours
      has it; OSError; FailedPrecondition where
      another process is meshing in the checkpoint. Ctrl-C cancels the mesh, or leaves it to the
      checkpoint, and is Interrupted, a KeyboardInterrupt with the mesh so far; a second Ctrl-C does
      not wait for that.
    """
    if epsilon is None:
        raise TypeError(what_is_missing())
    files, streamed = _files(save), [os.fspath(file) for file in _files(to)]
    if files and streamed:
        raise TypeError("mesh() takes either save or to")
    if keep_on_server and server is None:
        raise InvalidArgument(
            "keep_on_server is for a server that is named: a private one ends with the call. To keep the "
            "mesh without one, save it"
        )
    checked = CheckedOracle(oracle)
    for file in [*files, *streamed]:
        dimension = checked.dimension - bool(options.get("boundary_only"))
        check_save(file, dimension, checked.ambient_dimension)
    with contextlib.ExitStack() as stack:
        interrupts = stack.enter_context(Interrupts())
        if on_progress is None and somebody_looks_on(sys.stderr):
            on_progress = stack.enter_context(Patience(calm_output()))
        kept = None
        if checkpoint is not None:
            if server is not None:
                raise InvalidArgument(
                    "checkpoint is for a private server: one that is named keeps meshes itself, "
                    "with --data-dir"
                )
            kept = stack.enter_context(Checkpoint(checkpoint, keep))
        if credentials is not None:
            server = stack.enter_context(_connect(server, credentials))
        session = stack.enter_context(
            Run(
                oracle,
                epsilon,
                server,
                on_progress,
                options,
                keep=keep,
                scale=scale,
                every=False,
                checkpoint=kept,
                stays=keep_on_server,
                to=[] if kept is not None else streamed,
            )
        )
        interrupts.on_first = session.interrupt
        (finished,) = session  # or an exception
    if isinstance(finished, SavedMesh):
        finished.warn_if_uncertified(stacklevel=3)
        if require_certified and not finished.certified:
            assert finished.report is not None
            where = ", ".join(finished.paths)
            raise NotCertified(
                f"the mesh is not certified: {finished.report.what_failed}; it is in {where}"
            )
        return finished
    assert isinstance(finished, FinishedMesh)
    for file in [*files, *streamed]:
        try:
            finished.save(file)
        except (OSError, SaveError) as error:
            raise SaveError(f"{error}; the mesh is the exception's", mesh=finished) from error
    if require_certified and not finished.certified:
        raise NotCertified(
            f"the mesh is not certified: {finished.report.what_failed}; it is the exception's mesh",
            mesh=finished,
        )
    return SavedMesh.of(finished, streamed) if streamed else finished


@takes(MeshOptions)
def watch(
    oracle: Any,
    epsilon: Epsilon | None = None,
    server: str | Server | Client | None = None,
    on_progress: OnProgress | None = None,
    credentials: Credentials | None = None,
    keep: Keep | None = None,
    scale: Any = None,
    **options: Unpack[MeshOptions],
) -> Iterator[Mesh]:
    """The mesh as it grows: an iterator over Mesh; the last is a FinishedMesh.

    With an oracle, everything is as in stellate.mesh; closing the iterator cancels the mesh. With
    the name of a mesh in place of the oracle, a mesh that others made and serve is watched, from
    its beginning, and closing the iterator leaves it alone.
    """
    if credentials is not None:
        with _connect(server, credentials) as client:
            yield from watch(
                oracle, epsilon, client, on_progress, keep=keep, scale=scale, **options
            )
        return
    if isinstance(oracle, str):
        named = {"keep": keep, "scale": scale}
        given = [*options, *(name for name, value in named.items() if value is not None)]
        if given:
            raise TypeError(f"a mesh that exists already takes no {', '.join(given)}")
        yield from _watch_by_name(oracle, server, on_progress)
        return
    if epsilon is None:
        raise TypeError(what_is_missing())
    interrupts = Interrupts()
    with Run(oracle, epsilon, server, on_progress, options, keep=keep, scale=scale) as session:
        interrupts.on_first = session.interrupt
        meshes = iter(session)
        while True:
            with interrupts:
                grown = next(meshes, None)
            if grown is None:
                return
            assert isinstance(grown, Mesh)
            yield grown


def _watch_by_name(
    name: str, server: str | Server | Client | None, on_progress: OnProgress | None
) -> Iterator[Mesh]:
    if server is None:
        raise TypeError("to watch a mesh by its name, say on which server it is")
    if isinstance(server, Client):
        yield from Following(server, server.get(name), on_progress)
        return
    with Client(server) as client:
        yield from Following(client, client.get(name), on_progress)


@overload
def download(
    mesh_name: str,
    path: Path | None = None,
    *,
    server: str | Server | Client,
    unfinished: Literal["refuse", "wait"] = "refuse",
    on_progress: OnProgress | None = None,
    on_part: OnPart | None = None,
    credentials: Credentials | None = None,
) -> FinishedMesh: ...


@overload
def download(
    mesh_name: str,
    path: None = None,
    *,
    to: Path | Sequence[Path],
    server: str | Server | Client,
    unfinished: Unfinished = "refuse",
    revision: int | None = None,
    on_progress: OnProgress | None = None,
    on_part: OnPart | None = None,
    credentials: Credentials | None = None,
) -> SavedMesh: ...


@overload
def download(
    mesh_name: str,
    path: Path | None = None,
    *,
    server: str | Server | Client,
    unfinished: Unfinished = "refuse",
    revision: int | None = None,
    on_progress: OnProgress | None = None,
    on_part: OnPart | None = None,
    credentials: Credentials | None = None,
) -> Mesh: ...


def download(
    mesh_name: str,
    path: Path | None = None,
    *,
    to: Path | Sequence[Path] = (),
    server: str | Server | Client,
    unfinished: Unfinished = "refuse",
    revision: int | None = None,
    on_progress: OnProgress | None = None,
    on_part: OnPart | None = None,
    credentials: Credentials | None = None,
) -> Mesh | SavedMesh:
    """Fetches a mesh that is on a server; it stays there. A broken stream is resumed.

    Args:
      mesh_name: "meshes/<id>", as Client.create and Client.list give it.
      path: where to write it as well, as Mesh.save does. What its format cannot hold is an error
        before anything is waited for or fetched.
      to: a file or several that the mesh goes into as it comes, so that it takes little memory however
        large it is: the same bytes as by `path`, under that name when they are whole. A manifold with
        boundary is first put beside a .vtu, .msh or .obj, in files without names as large as that, and the
        simplices at its walls are in memory. Still fetched whole are a mesh that failed, was cancelled or
        is not over, and what a format needs whole: .stl .3mf .glb .npz and what meshio writes; the
        surfaces of solids in .off and .ply; a boundary alone in .vtu, .msh and .obj; pipes.
      server: "host:port", "unix:/path", a stellate.Server or Client.
      unfinished: what to do about a mesh that is not over: "refuse" it, "wait" for its end, however
        long that takes, or "take" it as it is now; "take" fetches what there is of a failed or
        cancelled mesh, too.
      revision: any that the mesh has had, counted from 1, whatever became of the mesh; None: the newest.
      on_progress: called in this thread with a stellate.Progress while the mesh is waited for.
      on_part: called at each part that comes, with the vertices and simplices that are here, and
        those of the whole mesh.
      credentials: as for stellate.mesh.

    Returns:
      The mesh: a FinishedMesh if it is the last revision of one that is over. With `to` a SavedMesh,
      whose `points` and `cells` are mapped from the .vtu file.

    Raises:
      MeshNotFound; FailedPrecondition for a mesh that is refused because it is not over; how the
      mesh failed, or Cancelled, with what there is of it in the exception's `mesh`; Unavailable.
    """
    number = revision or 0  # as the protocol counts
    with _client(server, credentials) as client, told(f"{mesh_name} is left on its server"):
        files = _files(to)
        if files:
            if path is not None:
                raise TypeError("download() takes either path or to")
            return fetch_to(client, mesh_name, files, number, unfinished, on_progress, on_part)
        mesh = fetch(client, mesh_name, number, unfinished, on_progress, on_part, path)
    asked_for_last = number == 0 and unfinished != "take"
    if asked_for_last and not isinstance(mesh, FinishedMesh):
        raise protocol_error(f"revision {mesh.revision} is not the last, or has no report")
    if path is not None:
        mesh.save(path)
    return mesh


def _files(paths: Path | Sequence[Path] | None) -> list[Path]:
    if paths is None:
        return []
    return [paths] if isinstance(paths, (str, os.PathLike)) else list(paths)


def _client(
    server: str | Server | Client, credentials: Credentials | None
) -> contextlib.AbstractContextManager[Client]:
    """The client that was given, which stays open, or one for the time being."""
    if isinstance(server, Client) and credentials is None:
        return contextlib.nullcontext(server)
    return _connect(server, credentials)


def _connect(server: str | Server | Client | None, credentials: Credentials | None) -> Client:
    if isinstance(server, Client):
        raise InvalidArgument("a Client has its credentials already: give it them")
    return Client(server, credentials)


def serve(
    oracle: Any,
    mesh_name: str,
    *,
    server: str | Server | Client,
    worker: str = "",
    max_chunk: int | None = None,
    credentials: Credentials | None = None,
) -> str:
    """One more worker for a mesh: answers the server's questions until the mesh is over.

    All workers of a mesh have to answer for the same manifold. Ctrl-C takes this worker away; its
    work goes to the others.

    A worker that comes when the mesh is over returns its state immediately, so a late batch job is a
    success. `worker` is its name, for logs; `max_chunk` the most points that one call of the oracle
    gets, as in stellate.mesh.

    Returns: the state that the mesh ended in, e.g. "SUCCEEDED".
    Raises: MeshNotFound, also for a mesh that was over and is no longer kept; what the oracle
        raises, after the server has it, too, or a StellateError.
    """
    with _client(server, credentials) as client, told("this worker left; others have its work"):
        return client.serve(oracle, mesh_name, worker=worker, max_chunk=max_chunk)
