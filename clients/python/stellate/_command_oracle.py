"""Oracles that are programs in any language: docs/using/pipe.md."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
import weakref
from collections import deque
from collections.abc import Iterator
from typing import Any, Callable, TypeVar

import numpy as np

from ._pipe.framing import Answer, CommandError, Question, reader
from ._pipe.greeting import (
    MOST_GREETING_BYTES,
    Garbled,
    Greeting,
    may_become_greeting,
    parse_greeting,
    quoted,
)
from ._pipe.process import Ended, Patience, Process
from .errors import InvalidArgument, NotConverged, OracleError

_MOST_PROCESSES = 1024
_REASON = "ORACLE_COMMAND"
_UNUSUAL = 4  # times the longest batch so far: of a command that is slow always
T = TypeVar("T")


class CommandOracle:
    """An oracle that is a program: it reads batches of queries from its standard input, and writes
    the answers to its standard output.

    Args:
      command: for /bin/sh -c.
      processes: of it, each with a batch of its own; so many threads may ask at a time.
      dimension, ambient_dimension: k and d; where the command says them too, they have to be the
        same.
      bounding_box, seeds: (lower (d,), upper (d,)); (m, d). Instead of the command's own.
      start_seconds: until its first line.
      silence_seconds: in a batch, without a byte read or written by it.
      on_restart: called with how a process ended otherwise than in order, when it is started again;
        by default that goes to the standard error.
      on_waiting: called with what is waited for, "waiting for the oracle command's first answer, to 40
        closest points, 5 s", once a process neither reads nor writes for `unremarked_seconds`, and for 4
        times what its longest batch took; and again at each doubling. By default that goes there, too.

    A process that ends after it has answered a batch is started again and asked the same; once for a
    batch. What else goes wrong is an OracleError that says what, in which row, and what the command
    last wrote to its standard error. No process outlives the oracle: `close` ends them, as does the
    end of a `with` block or of the program. Pickled, it starts processes of its own where it arrives.

    Raises: InvalidArgument, for options that make no sense or contradict the command; OracleError,
      for a command that does not begin as it should.
    """

    thread_safe = True

    def __init__(
        self,
        command: str,
        *,
        processes: int = 1,
        dimension: int | None = None,
        ambient_dimension: int | None = None,
        bounding_box: Any = None,
        seeds: Any = None,
        start_seconds: float = 60.0,
        silence_seconds: float = 600.0,
        on_restart: Callable[[str], None] | None = None,
        on_waiting: Callable[[str], None] | None = None,
        unremarked_seconds: float = 5.0,
    ) -> None:
        if not command:
            raise InvalidArgument("the oracle command is empty")
        if not isinstance(processes, int) or not 1 <= processes <= _MOST_PROCESSES:
            raise InvalidArgument(
                f"the number of processes has to be from 1 to {_MOST_PROCESSES}: {processes!r}"
            )
        if not (start_seconds > 0 and silence_seconds > 0 and unremarked_seconds > 0):
            raise InvalidArgument("the seconds that a command has must be positive")
        self._options = {
            "command": command,
            "processes": processes,
            "dimension": dimension,
            "ambient_dimension": ambient_dimension,
            "bounding_box": bounding_box,
            "seeds": seeds,
            "start_seconds": start_seconds,
            "silence_seconds": silence_seconds,
            "on_restart": on_restart,
            "on_waiting": on_waiting,
            "unremarked_seconds": unremarked_seconds,
        }
        self.processes = processes
        self._command, self._on_restart = command, on_restart
        self._start_seconds, self._silence_seconds = start_seconds, silence_seconds
        self._unremarked, self._on_waiting = unremarked_seconds, on_waiting or _say
        self._running: set[Process] = set()
        self._close = weakref.finalize(self, _end_all, self._running)
        self._idle: deque[_Speaker] = deque()
        self._wake = threading.Condition()
        self._failed: Exception | None = None
        self._wants_tangents = self._wants_sizes = False
        self._last = threading.local()
        try:
            self._start()
            self._settle(dimension, ambient_dimension, bounding_box, seeds)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Ends the processes; batches in progress fail."""
        with self._wake:
            self._failed = self._failed or OracleError("the oracle command is closed", _REASON)
            self._wake.notify_all()
        self._close()

    def __enter__(self) -> CommandOracle:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __reduce__(self) -> Any:
        return _again, (self._options,)

    # The oracle.

    def closest_point(self, points: np.ndarray) -> np.ndarray:
        """(n, d) -> (n, d). Raises: NotConverged, with what was found."""
        answer = self._ask(Question(self.dimension, np.asarray(points, dtype=np.float64)))
        if not answer.found.all():
            raise NotConverged(answer.points, answer.found)
        return answer.points

    def _intersect_flat(
        self, centers: np.ndarray, bases: np.ndarray, radii: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        answer = self._ask(Question(self.dimension, centers, bases, radii))
        return answer.points, answer.found

    def _tangent_basis(self, points: np.ndarray) -> np.ndarray:
        self._wants_tangents = True
        return self._beside("tangents", points)

    def _local_size(self, points: np.ndarray) -> np.ndarray:
        self._wants_sizes = True
        return self._beside("sizes", points)

    def _face_point(self, points: np.ndarray, face: tuple[int, ...]) -> np.ndarray:
        question = Question(self.dimension, np.asarray(points, dtype=np.float64), face=face)
        answer = self._ask(question)
        if not answer.found.all():
            raise NotConverged(answer.points, answer.found)
        return answer.points

    def _clearances(self, points: np.ndarray) -> np.ndarray:
        return self._beside("clearances", points)

    def _conormals(self, points: np.ndarray, face: tuple[int, ...]) -> np.ndarray:
        return self._beside("conormals", points, face)

    # Pieces.

    def _start(self) -> None:
        """Starts all processes, and then hears them."""
        try:
            for _ in range(self.processes):
                self._idle.append(self._another())
            self._greeting = self._idle[0].greet(self._start_seconds)
            for speaker in list(self._idle)[1:]:
                self._hear_again(speaker)
        except (Ended, RuntimeError) as error:
            raise OracleError(str(error), _REASON) from None
        except OSError as error:
            raise OracleError(
                f"the oracle command {quoted(self._command)} cannot be started: {error}", _REASON
            ) from None

    def _another(self) -> _Speaker:
        return _Speaker(self._command, self._running, self._unremarked, self._on_waiting)

    def _settle(self, k: int | None, d: int | None, bounding_box: Any, seeds: Any) -> None:
        """The options and the command's first line become one."""
        greeting = self._greeting
        self.about = greeting.about
        self.dimension = k = _agreed("k", greeting.dimension, k)
        self.ambient_dimension = d = _agreed("d", greeting.ambient_dimension, d)
        if not (1 <= k < d or (k == d and greeting.walls)):
            raise InvalidArgument(
                f"the dimension k = {k} has to be at least 1 and less than d = {d}"
            )
        if greeting.walls and not greeting.tangents:
            raise InvalidArgument(
                "an oracle with walls takes tangents: walls= goes with tangents=1"
            )
        if bounding_box is None and seeds is None:
            bounding_box, seeds = greeting.box, greeting.seeds
        if bounding_box is not None:
            self.bounding_box = tuple(np.array(corner, dtype=float) for corner in bounding_box)
            if [corner.shape for corner in self.bounding_box] != [(d,), (d,)]:
                raise InvalidArgument(f"the box and the seeds need d = {d} coordinates")
        if seeds is not None:
            self.seeds = np.array(seeds, dtype=float)
            if self.seeds.ndim != 2 or self.seeds.shape[1] != d:
                raise InvalidArgument(f"the box and the seeds need d = {d} coordinates")
        if bounding_box is None and seeds is None:
            raise InvalidArgument(
                "where the manifold is, neither box nor seeds say: give one, or have the command's "
                "first line say it"
            )
        if greeting.flats:
            self.intersect_flat = self._intersect_flat
        if greeting.tangents:
            self.tangent_basis = self._tangent_basis
        if greeting.sizes:
            self.local_size = self._local_size
        if greeting.walls:
            self.walls = greeting.walls
            self.face_point, self.clearances = self._face_point, self._clearances
            self.conormals = self._conormals

    def _beside(self, what: str, points: np.ndarray, face: tuple[int, ...] = ()) -> np.ndarray:
        """Tangents, sizes or walls at points that were answered before. What has been asked for once beside
        the points is asked for along with them from then on: one batch instead of two."""
        last: Answer | None = getattr(self._last, "answer", None)
        known = None if last is None else getattr(last, what)
        if (
            last is not None
            and known is not None
            and (not face or self._last.face == face)
            and np.array_equal(last.points[last.found], points)
        ):
            return np.asarray(known[last.found])
        answer = self._ask(
            Question(self.dimension, np.asarray(points, dtype=np.float64), face=face)
        )
        if not answer.found.all():
            row = int(np.argmin(answer.found))
            raise OracleError(
                f"the oracle command {quoted(self._command)} was asked for {what} at points that it "
                f"gave itself, and in row {row + 1} of {len(points)} it finds no closest point",
                _REASON,
            )
        return np.asarray(getattr(answer, what))

    def _ask(self, question: Question) -> Answer:
        n, d = question.points.shape
        question.tangents = self._greeting.tangents and self._wants_tangents
        question.sizes = self._greeting.sizes and self._wants_sizes
        question.walls = self._greeting.walls
        if not n:
            return Answer(
                np.empty((0, d)),
                np.empty(0, bool),
                np.empty((0, d, self.dimension)),
                np.empty(0),
                np.empty((0, question.walls)),
                np.empty((0, len(question.face), d)),
            )
        with self._speaker() as speaker:
            answer = self._ask_or_restart(question, speaker)
        self._last.answer, self._last.face = answer, question.face
        return answer

    def _ask_or_restart(self, question: Question, speaker: list[_Speaker]) -> Answer:
        text, silence = self._greeting.text, self._silence_seconds
        try:
            return speaker[0].ask(question, text, silence)
        except Ended as error:
            if not speaker[0].has_answered:
                raise
            if not speaker[0].ended_well():
                self._tell(str(error))
        speaker[0].end()
        speaker[0] = self._another()
        self._hear_again(speaker[0])
        return speaker[0].ask(question, text, silence)

    def _tell(self, how: str) -> None:
        if self._on_restart is not None:
            self._on_restart(how)
        else:
            print(f"stellate: {how}\nstellate: it is started again", file=sys.stderr)

    def _hear_again(self, speaker: _Speaker) -> None:
        if speaker.greet(self._start_seconds) != self._greeting:
            raise RuntimeError(
                f"the oracle command {quoted(self._command)} says another first line when it is "
                "started again"
            )

    @contextlib.contextmanager
    def _speaker(self) -> Iterator[list[_Speaker]]:
        """The next in turn, so that what differs between processes is seen; it may be replaced.
        Where it fails the whole oracle has."""
        with self._wake:
            self._wake.wait_for(lambda: self._failed or self._idle)
            if self._failed:
                raise self._failed
            mine = [self._idle.popleft()]
        try:
            yield mine
        except BaseException as error:
            failure = error
            if isinstance(error, (Ended, RuntimeError, OSError)):
                failure = OracleError(str(error), _REASON)
            with self._wake:
                if isinstance(failure, Exception):
                    self._failed = self._failed or failure
                    failure = self._failed
                else:  # Ctrl-C in the midst of a batch: it is unknown where in its answer it is
                    self._failed = self._failed or OracleError("it was interrupted", _REASON)
                self._wake.notify_all()
            mine[0].end()
            if failure is error:
                raise
            raise failure from None
        with self._wake:
            self._idle.append(mine[0])
            self._wake.notify_all()


def _say(what: str) -> None:
    print(f"stellate: {what}", file=sys.stderr)


def _again(options: dict[str, Any]) -> CommandOracle:
    return CommandOracle(**options)


def _end_all(running: set[Process]) -> None:
    for process in list(running):
        process.dismiss()  # all may end at the same time
    for process in list(running):
        process.end()
    running.clear()


def _agreed(name: str, said: int | None, given: int | None) -> int:
    if said is not None and given is not None and said != given:
        raise InvalidArgument(
            f"the command's first line says {name}={said}, and the options {given}"
        )
    agreed = said if said is not None else given
    if agreed is None:
        raise InvalidArgument(
            f"what {name} is, neither the options nor the command's first line say"
        )
    return int(agreed)


class _Speaker:
    """One process, from its first line on. What goes wrong is said in whole sentences, by Ended
    where the process ended, else by RuntimeError."""

    def __init__(
        self,
        command: str,
        running: set[Process],
        unremarked: float,
        on_waiting: Callable[[str], None],
    ) -> None:
        self._command, self._running = command, running
        self._unremarked, self._on_waiting = unremarked, on_waiting
        self._process = Process(command)
        running.add(self._process)
        self.has_answered = False
        self._longest = 0.0  # seconds that a batch took

    def _waiting_for(self, what: str, silence: float) -> Patience:
        return Patience(
            silence,
            max(self._unremarked, _UNUSUAL * self._longest),
            lambda seconds: self._on_waiting(f"waiting for {what}, {seconds:.0f} s"),
        )

    def greet(self, seconds: float) -> Greeting:
        greetings: list[Greeting] = []

        def take(came: bytearray) -> bool:
            end = came.find(b"\n")
            fits = may_become_greeting(bytes(came[:MOST_GREETING_BYTES]))
            if end < 0 and fits and len(came) <= MOST_GREETING_BYTES:
                return False
            end = end if end >= 0 else len(came)
            greetings.append(parse_greeting(bytes(came[:end])))
            del came[: end + 1]
            return True

        def act() -> Greeting:
            patience = self._waiting_for("the oracle command's first line", seconds)
            self._process.exchange(b"", take, patience)
            return greetings[0]

        return self._guarded("at its first line", act)

    def ask(self, question: Question, text: bool, silence: float) -> Answer:
        kind = "closest points" if question.bases is None else "flats"
        batch = f"{len(question.points)} {kind}"
        answer_to = "answer to" if self.has_answered else "first answer, to"

        def act() -> Answer:
            answer, asked = reader(question, text), time.monotonic()
            patience = self._waiting_for(f"the oracle command's {answer_to} {batch}", silence)
            self._process.exchange(question.to_bytes(text), answer.take, patience)
            self.has_answered = True
            self._longest = max(self._longest, time.monotonic() - asked)
            return answer.finish()

        return self._guarded(f"in a batch of {batch}", act)

    def end(self) -> None:
        self._process.end(hurry=True)
        self._running.discard(self._process)

    def ended_well(self) -> bool:
        return self._process.ended_well()

    def _guarded(self, where: str, act: Callable[[], T]) -> T:
        try:
            return act()
        except Ended as error:
            how = self._process.how_it_ended()
            raise Ended(self._sentence(where, f"{error}: {how}")) from None
        except (CommandError, Garbled, RuntimeError, OSError, ValueError) as error:
            says = "it says: " if isinstance(error, CommandError) else ""
            with contextlib.suppress(OSError, ValueError):
                self._process.read_errors()
            self.end()
            raise RuntimeError(self._sentence(where, f"{says}{error}")) from None

    def _sentence(self, where: str, what: str) -> str:
        errors = self._process.last_errors()
        return f"the oracle command {quoted(self._command)}, {where}: {what}{errors}"
