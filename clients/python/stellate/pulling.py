"""Oracles that pull: the questions come to a loop of the caller, on the caller's own thread.

For programs that may be entered on one thread alone, such as R, MATLAB, Julia and windows.
"""

from __future__ import annotations

import contextlib
import os
from typing import TYPE_CHECKING, Any

from ._checkpoint import Checkpoint
from ._chunks import Chunk, Declared, Puller
from ._credentials import Credentials
from ._epsilon import Epsilon
from ._generated.oracle_pb2 import QueryChunk, ServeOracleRequest
from ._mesh import FinishedMesh
from ._run import Run
from .client import Client
from .errors import InvalidArgument
from .options import SpecOptions, takes
from .oracle import CheckedOracle
from .report import Progress
from .server import Server

if TYPE_CHECKING:
    from typing_extensions import Unpack


__all__ = ["Chunk", "Puller", "pull", "pull_check"]


@takes(SpecOptions)
def pull(
    dimension: int,
    ambient_dimension: int,
    epsilon: Epsilon,
    server: str | Server | None = None,
    *,
    bounding_box: Any = None,
    intersect_flat: bool = False,
    tangent_basis: bool = False,
    local_size: bool = False,
    walls: int = 0,
    about: str = "",
    checkpoint: str | os.PathLike[str] | None = None,
    credentials: Credentials | None = None,
    max_chunk: int | None = None,
    **options: Unpack[SpecOptions],
) -> Puller:
    """Meshes a manifold whose questions are answered in a loop of yours, on your own thread.

        with stellate.pulling.pull(2, 3, 0.1, bounding_box=([-1.5] * 3, [1.5] * 3)) as worker:
            for chunk in worker:
                chunk.answer(closest(chunk.points))
        print(worker.mesh.report)

    Args:
      dimension, ambient_dimension: k and d.
      epsilon: a length, or "auto": then the first chunks are the doctor's.
      bounding_box: around the manifold: see stellate.Oracle. Without one `seeds` are needed.
      intersect_flat, tangent_basis, local_size: what the answers will have when a chunk wants it.
      walls: how many walls bound the manifold: then chunks may be about a face, and want clearances
        and conormals.
      about: one sentence for people, with which the verdict ends: see stellate.Oracle.
      server, checkpoint, credentials, max_chunk, options: as for stellate.mesh.

    The loop ends when the mesh is finished, and raises how it failed. A loop that takes minutes over a
    chunk has to let Python run meanwhile, or the server takes it for dead: see `answer_seconds`.
    """
    if checkpoint is not None and not (server is None and credentials is None):
        raise InvalidArgument("checkpoint is for a private server: one that is named keeps meshes")
    puller = Puller()
    declared = _examined(
        puller, dimension, ambient_dimension, bounding_box=bounding_box, walls=walls,
        seeds=options.get("seeds"), intersect_flat=intersect_flat, tangent_basis=tangent_basis, local_size=local_size,
        about=about,
    )  # fmt: skip

    def note(progress: Progress) -> None:
        puller.progress = progress

    def work() -> None:
        with contextlib.ExitStack() as stack:
            kept = None
            at: Any = server
            if checkpoint is not None:
                kept = stack.enter_context(Checkpoint(checkpoint))
            if credentials is not None:
                at = stack.enter_context(Client(server, credentials))
            session = Run(
                declared, epsilon, at, note, {**options, "max_chunk": max_chunk}, every=False,
                checkpoint=kept, ask=puller.ask,
            )  # fmt: skip
            stack.enter_context(session)
            puller.stop = session.interrupt
            if puller.left:
                session.interrupt()
            (finished,) = session
            assert isinstance(finished, FinishedMesh)
            puller.mesh = finished

    return puller.start(work).begun()


def pull_check(
    dimension: int,
    ambient_dimension: int,
    epsilon: float | None = None,
    *,
    bounding_box: Any = None,
    seeds: Any = None,
    intersect_flat: bool = False,
    tangent_basis: bool = False,
    local_size: bool = False,
    walls: int = 0,
    server: str | Server | None = None,
    credentials: Credentials | None = None,
) -> Puller:
    """As stellate.check, of an oracle whose questions are answered in a loop of yours.

        with stellate.pulling.pull_check(2, 3, bounding_box=([-1.5] * 3, [1.5] * 3)) as worker:
            for chunk in worker:
                chunk.answer(closest(chunk.points))
        print(worker.report)

    The arguments are those of pull(). An answer that cannot be one, and fail(), are findings, too.
    """
    puller = Puller()
    declared = _examined(
        puller, dimension, ambient_dimension, bounding_box=bounding_box, seeds=seeds, walls=walls,
        intersect_flat=intersect_flat, tangent_basis=tangent_basis, local_size=local_size,
    )  # fmt: skip

    def work() -> None:
        with Client(server, credentials) as client:
            puller.report = client.check(declared, epsilon)

    return puller.start(work).begun()


def _examined(puller: Puller, dimension: Any, ambient_dimension: Any, **oracle: Any) -> Declared:
    """An oracle whose methods, which a doctor calls, ask the puller."""

    def ask(chunk: QueryChunk) -> ServeOracleRequest:
        return puller.ask(CheckedOracle(declared), chunk, True)

    declared = Declared(dimension, ambient_dimension, ask, **oracle)
    return declared
