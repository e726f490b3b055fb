"""Ending gRPC's calls."""

from __future__ import annotations

import threading
from typing import Any

_PATIENCE_SECONDS = 5.0  # for a thread that has only to note the end


def end(call: Any) -> None:
    """Cancels a call, unless it has ended, and waits until gRPC's own thread has let go of it.

    An interpreter that ends before kills that thread, which may hold the call's lock. The call's
    finalizer takes the same lock, so that the process would never end.
    """
    let_go = threading.Event()
    call.cancel()
    if call.add_callback(let_go.set):  # else it has let go
        let_go.wait(_PATIENCE_SECONDS)
