"""Riding out the absence of a server."""

from __future__ import annotations

import dataclasses
import logging
import random
import threading
import time
from collections.abc import Iterator
from typing import Callable

import grpc

from ._shared import table
from .errors import MeshNotFound, StellateError, Unavailable

_log = logging.getLogger("stellate")

WAITS = table("reconnect.toml")


def is_transient(error: grpc.RpcError) -> bool:
    """Whether the server, or the way to it, was lost, so that the same call may succeed later.

    What a server drops arrives as CANCELLED where this side cancelled nothing.
    """
    code = error.code()
    if code is grpc.StatusCode.UNKNOWN:
        # What gRPC says of a stream whose connection went while it was being opened.
        return "Stream removed" in (error.details() or "")
    return code in (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED)


def pauses(rng: random.Random | None = None) -> Iterator[float]:
    """Seconds between attempts, longer each time up to a limit, each shortened at random.

    So the clients of a server that comes back do not come all together.
    """
    rng = rng or random.Random()
    full = WAITS["first_pause"]
    while True:
        yield full * (1 - WAITS["pause_jitter"] * rng.random())
        full = min(WAITS["pause_growth"] * full, WAITS["longest_pause"])


@dataclasses.dataclass
class ReconnectPolicy:
    """What the calls and streams of one client share."""

    give_up_seconds: float
    connect: Callable[[], object]  # waits a moment for a connection
    hopeless: Callable[[], StellateError | None] = lambda: None  # why it will not come back
    reached: bool = False  # something was heard of the server: it was there


class Reconnector:
    """The attempts at one call or stream. One thread makes them; any other may call stop().

    A server is lost with a warning in the log and back with another; `quiet` streams, as there
    are several next to one that is not, leave that to it.
    """

    def __init__(self, policy: ReconnectPolicy, quiet: bool = False) -> None:
        self._policy, self._quiet = policy, quiet
        self._stopped = threading.Event()
        self._attempts = 0
        self._lost_at = 0.0
        self._pauses = pauses()

    @property
    def lasts(self) -> bool:
        """Whether the attempt under way follows on one that was broken off."""
        return self._attempts > 0

    @property
    def stopped(self) -> bool:
        return self._stopped.is_set()

    def stop(self) -> None:
        """Ends the wait, and lets no other begin."""
        self._stopped.set()

    def heard(self) -> None:
        """The attempt brought something: the server is there."""
        self._policy.reached = True
        if not self._attempts:
            return
        if not self._quiet:
            _log.warning("the server is back after %.1f s", time.monotonic() - self._lost_at)
        self._attempts = 0
        self._pauses = pauses()

    def explain(self, error: StellateError) -> StellateError:
        """What a mesh that is not there means when it was there before."""
        if isinstance(error, MeshNotFound) and self.lasts:
            return Unavailable(
                "the server went away and came back without the mesh; it keeps meshes only with "
                "--data-dir",
                error.reason,
                error.details,
            )
        return error

    def wait_or_raise(self, error: grpc.RpcError, as_ours: StellateError) -> None:
        """Returns when it is time for another attempt.

        Raises: `as_ours`, or what is behind it, where waiting is of no use or has been stopped.
        """
        if not is_transient(error):
            raise as_ours from None
        if as_ours.reason == "SHUTTING_DOWN":  # said by a server
            self._policy.reached = True
        hopeless = self._policy.hopeless()
        if hopeless is not None:
            raise hopeless from None
        if self.stopped or not self._policy.reached:
            raise as_ours from None
        now = time.monotonic()
        if not self._attempts:
            self._lost_at = now
            if not self._quiet and self._policy.give_up_seconds > 0:
                _log.warning(
                    "lost the server (%s): trying again for up to %.0f s",
                    as_ours,
                    self._policy.give_up_seconds,
                )
        left = self._lost_at + self._policy.give_up_seconds - now
        if left <= 0:
            waited = f"; waited {now - self._lost_at:.1f} s for it" if self._attempts else ""
            raise Unavailable(f"{as_ours}{waited}", as_ours.reason, as_ours.details) from None
        self._attempts += 1
        if self._stopped.wait(min(next(self._pauses), left)):
            raise as_ours from None
        # Connections come about only while somebody waits for them, and a stream that finds none
        # fails immediately.
        self._policy.connect()
