"""Ctrl-C: asked for once, it ends work in good order; a second time, immediately."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType
from typing import Callable

from .errors import Interrupted


class Interrupts:
    """SIGINT while this is entered. A context manager, also one inside itself.

    `on_first`, once there is one, is called in a thread of its own at the first SIGINT, and what
    runs goes on until it takes note of `asked`. Any other SIGINT is an Interrupted.

    Nothing of that happens outside the main thread, or where the program itself has said what
    SIGINT does.
    """

    def __init__(self) -> None:
        self.asked = False
        self.on_first: Callable[[], object] | None = None
        self._depth = 0
        self._ours = False

    def __enter__(self) -> Interrupts:
        self._depth += 1
        in_main = threading.current_thread() is threading.main_thread()
        if in_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._take)
            self._ours = True
        return self

    def __exit__(self, kind: type[BaseException] | None, *raised: object) -> None:
        self._depth -= 1
        if self._ours and not self._depth:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            self._ours = False
        if kind is KeyboardInterrupt:
            raise Interrupted("ended immediately") from None

    def _take(self, number: int, frame: FrameType | None) -> None:
        if self.asked or self.on_first is None:
            signal.default_int_handler(number, frame)
        self.asked = True
        threading.Thread(target=self.on_first, name="interrupt", daemon=True).start()


@contextlib.contextmanager
def told(what: str) -> Iterator[None]:
    """Ctrl-C in here says `what` instead of where it struck."""
    try:
        yield
    except Interrupted:
        raise
    except KeyboardInterrupt:
        raise Interrupted(what) from None
