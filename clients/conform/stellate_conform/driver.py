"""The client's side: a program that is told what to do, or a person who does it."""

from __future__ import annotations

import queue
import subprocess
import sys
import threading
from collections.abc import Sequence


class Speechless(Exception):
    """The client can be told no more."""


class Program:
    """A client's program, run with the server's address, which obeys lines with a line each."""

    def __init__(self, command: Sequence[str], address: str) -> None:
        """Raises: OSError."""
        self._process = subprocess.Popen(
            [*command, address], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        self._said: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._said.put(line.strip())
        self._said.put(None)

    def tell(self, line: str, seconds: float) -> str:
        """What it answers. Raises: Speechless."""
        assert self._process.stdin is not None
        try:
            print(line, file=self._process.stdin, flush=True)
            said = self._said.get(timeout=seconds)
        except OSError:
            said = None
        except queue.Empty:
            raise Speechless(f"no answer to `{line}` within {seconds:g} s") from None
        if said is None:
            raise Speechless(f"the client ended at `{line}`")
        return said

    def close(self) -> None:
        assert self._process.stdin is not None
        try:
            self._process.stdin.close()
            self._process.wait(5)
        except (OSError, subprocess.TimeoutExpired):
            self._process.kill()
            self._process.wait()


class Person:
    """Somebody at a terminal, who starts a client by hand and says what came of it."""

    def __init__(self, address: str) -> None:
        self._address = address

    def tell(self, line: str, seconds: float) -> str:
        print(f"{self._address}  {line}\n  what came of it? ", end="", file=sys.stderr, flush=True)
        said = sys.stdin.readline()
        if not said:
            raise Speechless("nobody answers any more")
        return said.strip()

    def close(self) -> None:
        pass
