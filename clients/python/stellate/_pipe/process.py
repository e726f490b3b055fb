"""A command of the shell, and a conversation with it."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import select
import signal
import subprocess
import time
from collections.abc import Callable

from .greeting import quoted

_GRACE = 2.0  # seconds between an end of input, SIGTERM and SIGKILL
_LAST_WORDS = 1.0  # seconds from closed pipes to the end
_KEPT_ERRORS = 4000  # bytes; a server takes 4096 for a failure in all
_SHOWN_LINES = 10
_READ_BYTES = 1 << 16


@dataclasses.dataclass(frozen=True)
class Patience:
    """How long a process may be silent, in seconds without a byte read or written by it.

    Attributes:
      silence: then it has failed.
      unremarked: then, and whenever the silence has doubled, `on_waiting` is called with how long it has
        lasted.
    """

    silence: float
    unremarked: float
    on_waiting: Callable[[float], None]


class Ended(Exception):
    """The process ended, or closed a pipe, before all was said."""


class Process:
    """A command of the shell in a process group of its own, with pipes to its standard streams."""

    def __init__(self, command: str) -> None:
        self._process = subprocess.Popen(
            ["/bin/sh", "-c", command],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            bufsize=0,
            start_new_session=True,  # so that a terminal's Ctrl-C is ours to handle
        )
        assert self._process.stdin and self._process.stdout and self._process.stderr
        self._input, self._output = self._process.stdin, self._process.stdout
        self._errors = self._process.stderr
        for stream in (self._input, self._output, self._errors):
            os.set_blocking(stream.fileno(), False)
        self._errors_open = True
        self._last_errors = b""
        self.unread = bytearray()  # of its output
        self._over = False
        self._status: int | None = None  # of its exit, or minus the signal's number

    def exchange(
        self, question: bytes, take: Callable[[bytearray], bool], patience: Patience
    ) -> None:
        """Writes the question and at the same time reads, until `take` is content with what came.

        Nothing is left unread then. Raises: Ended; RuntimeError when the process is silent for too long, or
        says more than it should; and what `take` raises.
        """
        if self.unread:
            self._too_much(question, len(question))
        left, done, silence = memoryview(question), False, patience.silence
        last, remark = time.monotonic(), patience.unremarked
        while not done:
            read, written = self._wait(bool(left), last + min(silence, remark))
            moved = False
            if read:  # first: who closes its input may have answered nevertheless
                moved = self._read(_standing(question, len(left)))
                done = moved and take(self.unread)
            if written and not done:
                count = self._write(left, _standing(question, len(left)))
                left, moved = left[count:], moved or count > 0
            now = time.monotonic()
            if moved:
                last, remark = now, patience.unremarked
            elif not done and now >= last + silence:
                raise RuntimeError(
                    f"it has neither read nor written for {silence:g} seconds"
                    + _standing(question, len(left))
                )
            elif not done and now >= last + remark:
                patience.on_waiting(now - last)
                remark *= 2
        if left or self.unread:
            self._too_much(question, len(left))

    def _wait(self, writing: bool, deadline: float) -> tuple[bool, bool]:
        """Whether there is something to read, and room to write."""
        poll = select.poll()
        poll.register(self._output, select.POLLIN)
        if writing:
            poll.register(self._input, select.POLLOUT)
        if self._errors_open:
            poll.register(self._errors, select.POLLIN)
        ready = poll.poll(max(0.0, min(1000 * (deadline - time.monotonic()), 1e9)))
        numbers = {number for number, _ in ready}
        if self._errors_open and self._errors.fileno() in numbers:
            self._errors_open = self.read_errors()
        return self._output.fileno() in numbers, writing and self._input.fileno() in numbers

    def _read(self, standing: str) -> bool:
        try:
            came = os.read(self._output.fileno(), _READ_BYTES)
        except (BlockingIOError, InterruptedError):
            return False
        if not came:
            raise Ended("it closed its standard output" + standing)
        self.unread += came
        return True

    def _write(self, left: memoryview, standing: str) -> int:
        try:
            return os.write(self._input.fileno(), left)
        except BrokenPipeError:
            raise Ended("it closed its standard input" + standing) from None
        except (BlockingIOError, InterruptedError):
            return 0

    def _too_much(self, question: bytes, left: int) -> None:
        if left:
            raise RuntimeError("it answered before it was asked" + _standing(question, left))
        raise RuntimeError(f"it wrote more than it was asked for: {quoted(self.unread)}")

    def read_errors(self) -> bool:
        """Reads what its standard error has. False at its end."""
        more, came = _drained(self._errors.fileno())
        self._last_errors += came
        if len(self._last_errors) > _KEPT_ERRORS:
            kept = self._last_errors[-_KEPT_ERRORS:]
            self._last_errors = b"...\n" + kept.partition(b"\n")[2]
        return more

    def last_errors(self) -> str:
        """The last of what it wrote there, for a message; empty or starting on a line of its own."""
        lines = self._last_errors.decode(errors="replace").rstrip("\n").split("\n")
        if lines == [""]:
            return ""
        return "\nits standard error ends:\n" + "\n".join(lines[-_SHOWN_LINES:])

    def dismiss(self) -> None:
        """Its end may come: it is not waited for."""
        with contextlib.suppress(OSError):
            self._input.close()

    def end(self, hurry: bool = False) -> None:
        """Ends it and all that it started. In order: its input ends, and it has two seconds to do so
        too. Then, or immediately: SIGTERM, and what is left of it after two seconds more, SIGKILL."""
        if self._over:
            return
        self._over = True
        self.dismiss()
        if hurry or not self._await_end(_GRACE, of_all=True):
            self._signal(signal.SIGTERM)
            self._await_end(_GRACE, of_all=True)
        self._signal(signal.SIGKILL)
        self._process.wait()
        self._output.close()
        self._errors.close()

    def how_it_ended(self) -> str:
        """Waits a second for its end. Such as "it ended with status 3"."""
        if not self._await_end(_LAST_WORDS, of_all=False):
            return "it is still there"
        status = self._status or 0
        if status < 0:
            return f"it was ended by signal {-status} ({signal.strsignal(-status)})"
        unknown = ", which is the shell's for a command that is not found" if status == 127 else ""
        return f"it ended with status {status}{unknown}"

    def ended_well(self) -> bool:
        return self._status == 0

    def _signal(self, number: int) -> None:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, number)

    def _await_end(self, patience: float, of_all: bool) -> bool:
        """Whether it has come within the time: its own, or that of all who hold its output."""
        deadline = time.monotonic() + patience
        while True:
            self._look()
            ended = self._status is not None
            output_ended = of_all and not _drained(self._output.fileno())[0]
            errors_ended = not self.read_errors()
            if ended and (not of_all or (output_ended and errors_ended)):
                return True
            if time.monotonic() >= deadline:
                return False
            time.sleep(0.002)

    def _look(self) -> None:
        """It is not collected before all are ended: its group's number has no other owner until then."""
        seen = os.waitid(os.P_PID, self._process.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)
        if seen is not None:
            exited = seen.si_code == os.CLD_EXITED
            self._status = seen.si_status if exited else -seen.si_status


def _standing(question: bytes, left: int) -> str:
    if not question:
        return ", and its first line never came: is it written, and flushed?"
    return f", after it took {len(question) - left} of {len(question)} bytes"


def _drained(number: int) -> tuple[bool, bytes]:
    """Whether there may be more, and all that is there now."""
    parts: list[bytes] = []
    while True:
        try:
            came = os.read(number, _READ_BYTES)
        except BlockingIOError:
            return True, b"".join(parts)
        except InterruptedError:
            continue
        if not came:
            return False, b"".join(parts)
        parts.append(came)
