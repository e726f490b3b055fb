"""Showing a mesh at work."""

from __future__ import annotations

import multiprocessing
import re
import shutil
import sys
import threading
import time
from typing import TextIO

from ._notebook import NotebookBar, in_notebook
from .report import Progress

__all__ = ["ProgressBar", "progress_bar"]

_REDRAW_SECONDS = 0.05
_PLAIN_SECONDS = 5.0
_PATIENCE_SECONDS = 10.0  # that a person looks at nothing before wondering
_PHASES = {
    "SEEDING": "seeding",
    "REFINING": "refining",
    "CERTIFYING": "certifying",
    "DONE": "done",
}


class ProgressBar:
    """An `on_progress` that keeps one live line on a terminal, and else prints few plain lines."""

    def __init__(self, title: str = "", file: TextIO | None = None) -> None:
        self._title = title + " " if title else ""
        self._file = sys.stderr if file is None else file
        self._live = self._file.isatty()
        self._last_time = -1e9
        self._last_phase = ""
        self._open = False

    def __call__(self, progress: Progress) -> None:
        now = time.monotonic()
        new_phase = progress.phase != self._last_phase
        pause = _REDRAW_SECONDS if self._live else _PLAIN_SECONDS
        if not new_phase and now - self._last_time < pause:
            return
        self._last_time, self._last_phase = now, progress.phase
        if self._live:
            width = shutil.get_terminal_size().columns
            self._file.write("\r" + self._line(progress, width)[: width - 1] + "\x1b[K")
            self._open = True
        else:
            self._file.write(f"{self._title}{self._numbers(progress)}\n")
        self._file.flush()

    def note(self, text: str) -> None:
        """A line of its own. Called by stellate.mesh with what it has chosen."""
        self._file.write(("\r\x1b[K" if self._open else "") + self._title + text + "\n")
        self._file.flush()
        self._open = False

    def close(self) -> None:
        """Ends the live line. Called by stellate.mesh when the mesh is over."""
        if self._open:
            self._file.write("\n")
            self._file.flush()
            self._open = False
        self._last_phase = ""

    def _line(self, progress: Progress, width: int) -> str:
        numbers = self._numbers(progress)
        cells = max(10, min(30, width - len(self._title) - len(numbers) - 12))
        filled = progress.fraction * cells
        whole = int(filled)
        part = " ▏▎▍▌▋▊▉"[int((filled - whole) * 8)] if whole < cells else ""
        bar = ("█" * whole + part).ljust(cells)
        return f"{self._title}{100 * progress.fraction:3.0f} % │{bar}│ {numbers}"

    @staticmethod
    def _numbers(progress: Progress) -> str:
        text = f"{_PHASES.get(progress.phase, progress.phase.lower())}, round {progress.round}, "
        text += f"{progress.vertices:,} vertices, {progress.elapsed_seconds:.1f} s"
        if progress.remaining_seconds > 0 and progress.phase != "DONE":
            text += f", {progress.remaining_seconds:.0f} s left"
        return text


def progress_bar(title: str = "", file: TextIO | None = None) -> ProgressBar | NotebookBar:
    """A progress bar for `stellate.mesh(..., on_progress=stellate.progress_bar())`.

    Args:
      title: put before the bar.
      file: where to. By default, in a notebook, the cell: a bar and, with matplotlib, the mesh as it
        grows; elsewhere standard error. If it is no terminal, a line at each phase and every few
        seconds.
    """
    if file is None and in_notebook():
        return NotebookBar(title, ProgressBar._numbers)
    return ProgressBar(title, file)


class Patience:
    """An `on_progress` for who gave none: it says one line, once, when the work takes long.

    The time counts from entering it, a context manager, and what is left sooner says nothing.
    """

    def __init__(self, file: TextIO, seconds: float = _PATIENCE_SECONDS) -> None:
        self._file, self._seconds = file, seconds
        self._so_far = "no vertices yet"
        self._timer = threading.Timer(seconds, self._speak)
        self._timer.daemon = True

    def __enter__(self) -> Patience:
        self._timer.start()
        return self

    def __exit__(self, *unused: object) -> None:
        self._timer.cancel()

    def __call__(self, progress: Progress) -> None:
        if not progress.vertices and not progress.queries:
            return
        self._so_far = f"{progress.vertices:,} vertices by {progress.queries:,} queries so far"

    def note(self, text: str) -> None:
        """As a ProgressBar's."""
        self._so_far = re.sub(r", \d+ s$", "", text)  # the time that is said is this one's

    def _speak(self) -> None:
        self._file.write(
            f"stellate: at work for {self._seconds:.0f} s, {self._so_far}; "
            "on_progress=stellate.progress_bar() shows how it goes, Ctrl-C ends it\n"
        )
        self._file.flush()


def somebody_looks_on(file: TextIO | None) -> bool:
    """Whether a person sees immediately what the program writes there: on a terminal, or in a notebook.

    Threads and processes beside the main ones leave it to that to speak.
    """
    if threading.current_thread() is not threading.main_thread():
        return False
    if file is None or multiprocessing.parent_process() is not None:
        return False
    return file.isatty() or type(file).__module__.startswith("ipykernel.")
