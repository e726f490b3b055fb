"""Strangers that hold on: each function is one stranger, until `end` (seconds since the epoch)."""

from __future__ import annotations

import itertools
import time
from typing import Callable, Iterator

import raw_http2 as raw

SERVICE = "/stellate.v1.Stellate/"
_FRAME = 16_384  # bytes of the largest frame that a client may send unasked
_MESSAGE = 4 << 20  # --max-message-bytes


def endless_string() -> Iterator[bytes]:
    """The frames of a block whose first header is a string of a gigabyte."""
    length = b"\0\1x" + b"\x7f" + b"\x81\xff\xff\xff\x03"
    yield raw.frame(raw.HEADERS, 0, 1, length)
    yield from itertools.repeat(raw.frame(raw.CONTINUATION, 0, 1, bytes(_FRAME)))


def endless_headers() -> Iterator[bytes]:
    """The frames of a block of small headers, without end."""
    one = b"\0\1a\1b"
    yield raw.frame(raw.HEADERS, 0, 1, one)
    yield from itertools.repeat(raw.frame(raw.CONTINUATION, 0, 1, (_FRAME // 50) * one))


def endless_frames() -> Iterator[bytes]:
    """A string of a gigabyte, a byte to a frame."""
    yield raw.frame(raw.HEADERS, 0, 1, b"\0\1x" + b"\x7f" + b"\x81\xff\xff\xff\x03")
    yield from itertools.repeat(1000 * raw.frame(raw.CONTINUATION, 0, 1, b"y"))


def endless_number() -> Iterator[bytes]:
    """The length of a string, with zeros before it without end."""
    yield raw.frame(raw.HEADERS, 0, 1, b"\0\x7f")
    yield from itertools.repeat(raw.frame(raw.CONTINUATION, 0, 1, b"\x80" * _FRAME))


def _say(host: str, port: int, end: float, mbit: float,
         words: Callable[[], Iterator[bytes]]) -> None:
    """Says them at that rate; hung up on, again from the start."""
    while time.time() < end:
        try:
            connection = raw.Connection(host, port)
        except OSError:
            time.sleep(0.01)
            continue
        begin, sent = time.monotonic(), 0
        connection.greet()
        for part in words():
            if connection.closed or time.time() > end:
                break
            connection.send(part)
            sent += len(part)
            if mbit:
                time.sleep(max(0.0, begin + sent * 8e-6 / mbit - time.monotonic()))
        connection.close()


def _saying(words: Callable[[], Iterator[bytes]]) -> Callable[[str, int, float, float], None]:
    return lambda host, port, end, mbit: _say(host, port, end, mbit, words)


ENDLESS = (endless_string, endless_headers, endless_frames, endless_number)  # header blocks

STRANGERS: dict[str, Callable[[str, int, float, float], None]] = {
    words.__name__: _saying(words) for words in ENDLESS
}
