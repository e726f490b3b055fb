"""Oracles that pull: the questions come to a loop of the caller, on the caller's own thread.

For programs that may be entered on one thread alone, such as R, MATLAB, Julia and windows.
"""

from __future__ import annotations

from typing import Any

from ._chunks import Declared, Puller
from ._credentials import Credentials
from ._run import Run
from ._server import Server
from ._worker import Worker
from .client import Client
from .errors import InvalidArgument
from .report import Progress


class _PullingClient(Client):
    """Its workers hand their chunks to a Puller."""

    puller: Puller

    def worker(self, *arguments: Any, **options: Any) -> Worker:
        return super().worker(*arguments, **options, ask=self.puller.ask)


def pull(
    dimension: int,
    ambient_dimension: int,
    epsilon: float,
    server: str | Server | None = None,
    *,
    bounding_box: Any = None,
    seeds: Any = None,
    intersect_flat: bool = False,
    tangent_basis: bool = False,
    local_size: bool = False,
    credentials: Credentials | None = None,
    **criteria: Any,
) -> Puller:
    """Meshes a manifold whose questions are answered in a loop of yours, on your own thread.

        with stellate.pull(2, 3, 0.1, bounding_box=([-1.5] * 3, [1.5] * 3)) as worker:
            for chunk in worker:
                chunk.answer(closest(chunk.points))
        print(worker.mesh.report)

    Args:
      dimension, ambient_dimension: k and d.
      epsilon: a length; "auto" needs an oracle that can be called.
      bounding_box, seeds: where the manifold is: see stellate.Oracle. One of the two is needed.
      intersect_flat, tangent_basis, local_size: what the answers will have when a chunk wants it.
      server, credentials, criteria: as for stellate.mesh; `workers` is 1.

    The loop ends when the mesh is finished, and raises how it failed. A loop that takes minutes over a
    chunk has to let Python run meanwhile, or the server takes it for dead: see `answer_seconds`.
    """
    if isinstance(epsilon, str):
        raise InvalidArgument("epsilon='auto' needs an oracle that can be called: give a length")
    declared = Declared(
        dimension,
        ambient_dimension,
        intersect_flat=intersect_flat,
        tangent_basis=tangent_basis,
        local_size=local_size,
    )
    declared.bounding_box, declared.seeds = bounding_box, seeds
    puller = Puller()
    client = _PullingClient(server, credentials)
    client.puller = puller

    def note(progress: Progress) -> None:
        puller.progress = progress

    try:
        session = Run(declared, epsilon, client, note, {**criteria, "workers": 1}, every=False)
    except BaseException:
        client.close()
        raise

    def work() -> None:
        try:
            with session:
                (puller.mesh,) = session
        finally:
            client.close()

    puller.stop = session.interrupt
    return puller.start(work)
