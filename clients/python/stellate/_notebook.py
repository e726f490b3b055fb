"""Progress in the cell of a notebook: a bar, and the mesh as it grows."""

from __future__ import annotations

import base64
import html
import io
import sys
import time
from typing import Any, Callable, TextIO

from ._complex import Complex
from ._plot import plot
from .errors import InvalidArgument
from .report import Progress

_REDRAW_SECONDS = 0.25
_FRAME_SECONDS = 1.0  # between pictures, at least
_SHARE = 0.1  # of the time, at most, goes into pictures
_FRAME_INCHES, _FRAME_DPI = 3.2, 100
_MOST_DRAWN = 60_000  # simplices


def in_notebook() -> bool:
    """Whether what is shown appears in a notebook's cell."""
    return type(sys.stderr).__module__.startswith("ipykernel.") and "IPython" in sys.modules


def calm_output() -> TextIO:
    """For a line that is no complaint: a notebook shows standard error in red."""
    return sys.stdout if in_notebook() else sys.stderr


class NotebookBar:
    """An `on_progress` that keeps one output of the cell, which IPython shows."""

    def __init__(self, title: str, numbers: Callable[[Progress], str]) -> None:
        from IPython.display import HTML, display

        self._title, self._numbers, self._html = title, numbers, HTML
        self._display: Callable[..., Any] = display
        self._handle: Any = None
        self._notes: list[str] = []
        self._frame = b""
        self._progress: Progress | None = None
        self._last_time = self._next_frame = -1e9

    def __call__(self, progress: Progress) -> None:
        new_phase = self._progress is None or progress.phase != self._progress.phase
        self._progress = progress
        if new_phase or time.monotonic() - self._last_time >= _REDRAW_SECONDS:
            self._show()

    def look(self, mesh_so_far: Callable[[], Complex]) -> None:
        """Called by stellate.mesh behind each progress, with what gives the mesh as it is."""
        begin, progress = time.monotonic(), self._progress
        if progress is None or not 0 < progress.simplices <= _MOST_DRAWN:
            return
        if begin < self._next_frame and progress.phase != "DONE":
            return
        try:
            self._frame = _picture(mesh_so_far())
        except (ImportError, InvalidArgument):  # no matplotlib; or nothing to see yet
            self._next_frame = begin + _FRAME_SECONDS
            return
        end = time.monotonic()
        self._next_frame = end + max(_FRAME_SECONDS, (end - begin) / _SHARE)
        self._show()

    def note(self, text: str) -> None:
        """A line below the bar. Called by stellate.mesh with what it has chosen."""
        self._notes.append(text)
        self._show()

    def close(self) -> None:
        """Shows how it ended. Called by stellate.mesh when the mesh is over."""
        self._show()
        self._handle = self._progress = None  # the next mesh has an output of its own
        self._notes, self._frame, self._next_frame = [], b"", -1e9

    def _show(self) -> None:
        self._last_time = time.monotonic()
        shown = self._html(self._text())
        if self._handle is None:
            self._handle = self._display(shown, display_id=True)
        else:
            self._handle.update(shown)

    def _text(self) -> str:
        lines = [f"<div>{html.escape(self._title)}"]
        if self._progress is not None:
            share, numbers = 100 * self._progress.fraction, self._numbers(self._progress)
            lines.append(
                f'<progress max="100" value="{share:.0f}" style="width:16em;vertical-align:middle" '
                f'aria-label="share of the work that is done"></progress> {share:.0f} %, '
                f"{html.escape(numbers)}"
            )
        lines += [f"<br>{html.escape(note)}" for note in self._notes]
        if self._frame:
            data = base64.b64encode(self._frame).decode()
            lines.append(f'<br><img alt="the mesh so far" src="data:image/png;base64,{data}">')
        return "".join([*lines, "</div>"])


def _picture(mesh: Complex) -> bytes:
    """A small PNG. Not by pyplot's own figures, which a notebook would show once more."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
        from mpl_toolkits import mplot3d  # noqa: F401, which adds the projection
    except ImportError:
        raise ImportError("there is no matplotlib") from None
    figure = Figure(figsize=(_FRAME_INCHES, _FRAME_INCHES), dpi=_FRAME_DPI)
    FigureCanvasAgg(figure)
    flat = mesh.ambient_dimension == 2
    axes = figure.add_axes((0, 0, 1, 1), projection=None if flat else "3d")
    plot(mesh, ax=axes, frame=False)
    file = io.BytesIO()
    figure.savefig(file, format="png")
    return file.getvalue()
