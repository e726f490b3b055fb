"""One interpreter for all Python blocks of a page, as of a reader who types along.

Run as a program it is that interpreter: a line of JSON comes with a block's text, what it prints goes
out, then a line with its status.
"""

from __future__ import annotations

import json
import os
import re
import secrets
import signal
import subprocess
import sys
import threading
import traceback

NUMBER = r"-?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?"
# By how much of itself a number may differ: on another machine oracles round otherwise. A change of the
# mesher that moves it farther makes the page stale. A count below a hundred is exact.
NEAR = 0.05


class Session:
    """Raises, where a block fails or does not end: RuntimeError with what it printed."""

    def __init__(self, folder: str, environment: dict[str, str], patience: float) -> None:
        self._end = secrets.token_hex(8)
        self._patience = patience
        self._process = subprocess.Popen(
            ["python3", os.path.abspath(__file__), self._end], cwd=folder, env=environment,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            start_new_session=True,
        )  # fmt: skip
        self.printed = ""

    def run(self, code: str) -> None:
        """What it prints is in `printed`."""
        assert self._process.stdin and self._process.stdout
        timer = threading.Timer(self._patience, self._kill)
        timer.start()
        try:
            self._process.stdin.write(json.dumps(code) + "\n")
            self._process.stdin.flush()
            self.printed = ""
            for line in self._process.stdout:
                if line.startswith(self._end):
                    if line.split()[1] != "0":
                        break
                    return
                self.printed += line
        finally:
            timer.cancel()
        raise RuntimeError(f"it failed, or did not end. It printed:\n{self.printed}")

    def close(self) -> None:
        self._kill()
        self._process.communicate()

    def _kill(self) -> None:
        try:
            os.killpg(self._process.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass


def difference(shown: str, printed: str) -> str | None:
    """In words, where what a page shows is not what was printed: all words have to be there, in their
    order, and numbers near; `...` stands for anything."""
    pattern, wanted = "", []
    for part in re.split(rf"(\.\.\.|{NUMBER}|\s+)", shown.strip()):
        if part == "...":
            pattern += r"[\s\S]*?"
        elif re.fullmatch(NUMBER, part):
            pattern += rf"({NUMBER})"
            wanted.append(part)
        else:
            pattern += r"\s+" if part and not part.strip() else re.escape(part)
    match = re.fullmatch(pattern, printed.strip())
    if match is None:
        return f"the page shows\n{shown}\nand what was printed is\n{printed}"
    for mine, its in zip(wanted, match.groups()):
        a, b = (float(text.replace(",", "")) for text in (mine, its))
        count = "." not in mine and "e" not in mine
        near = 0.0 if count and abs(a) < 100 else NEAR
        if abs(a - b) > near * abs(a):
            return f"the page shows {mine} where {its} was printed:\n{printed}"
    return None


def main() -> None:
    space: dict[str, object] = {"__name__": "__main__"}
    for line in sys.stdin:
        status = 0
        try:
            exec(compile(json.loads(line), "block", "exec"), space)
        except BaseException:  # an interruption is one of them
            traceback.print_exc()
            status = 1
        sys.stderr.flush()
        print(f"{sys.argv[1]} {status}", flush=True)


if __name__ == "__main__":
    main()
