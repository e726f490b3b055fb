"""A command's first line; docs/using/pipe.md is its specification."""

from __future__ import annotations

import dataclasses

import numpy as np

from ..errors import InvalidArgument

MOST_GREETING_BYTES = 1 << 20
_FIRST_WORD = b"stellate-oracle"
_MOST_WALLS = 64
_MOST_DIMENSIONS = 1 << 20  # servers allow far less


class Garbled(Exception):
    """What came is not what the specification wants; the words say where and what."""


def quoted(text: bytes | str) -> str:
    """What came, fit to be shown: at most 80 bytes, odd ones as \\x1b."""
    data = text.encode(errors="replace") if isinstance(text, str) else bytes(text[:81])
    shown = "".join(chr(c) if 32 <= c <= 126 else f"\\x{c:02x}" for c in data[:80])
    return f"'{shown}...'" if len(data) > 80 else f"'{shown}'"


def parse_box(text: str) -> tuple[np.ndarray, np.ndarray]:
    """Of "x1,...,xd:y1,...,yd", the lower and the upper corner. Raises: InvalidArgument."""
    corners = [_coordinates(corner) for corner in text.split(":")]
    alike = len(corners) == 2 and corners[0].size and corners[0].shape == corners[1].shape
    if alike and (corners[0] < corners[1]).all():
        return corners[0], corners[1]
    raise InvalidArgument(
        f"{quoted(text)} is not a box: the lower corner, a colon and the upper corner, such as "
        "-1,-1,-1:1,1,1, the lower smaller in every coordinate"
    )


def parse_points(text: str) -> np.ndarray:
    """(m, d) of "x1,...,xd;y1,...,yd;...". Raises: InvalidArgument."""
    rows = [_coordinates(row) for row in text.split(";")]
    if not rows[0].size or any(row.shape != rows[0].shape for row in rows):
        raise InvalidArgument(
            f"{quoted(text)} is not a list of points, such as 1,0,0;0,1,0, all of as many "
            "coordinates"
        )
    return np.array(rows)


def _coordinates(text: str) -> np.ndarray:
    """Numbers between commas; none when they are none."""
    try:
        numbers = np.array([float(word) for word in text.split(",")])
    except ValueError:
        return np.empty(0)
    return numbers if np.isfinite(numbers).all() else np.empty(0)


@dataclasses.dataclass
class Greeting:
    """A command's first line. Two are equal where they are about the same oracle."""

    text: bool
    dimension: int | None = None
    ambient_dimension: int | None = None
    tangents: bool = False
    flats: bool = False
    sizes: bool = False
    walls: int = 0
    box: tuple[np.ndarray, np.ndarray] | None = dataclasses.field(default=None, compare=False)
    seeds: np.ndarray | None = dataclasses.field(default=None, compare=False)
    about: str = dataclasses.field(default="", compare=False)


def may_become_greeting(begun: bytes) -> bool:
    """Whether a first line begins so. What does not is never one, whatever follows."""
    begun = begun.lstrip(b" \t")
    return _FIRST_WORD.startswith(begun[: len(_FIRST_WORD)])


def parse_greeting(line: bytes) -> Greeting:
    """The line without its end. Raises: Garbled."""
    words = line.decode(errors="replace").split()
    if not words or words[0] != _FIRST_WORD.decode():
        raise Garbled(
            "its first line has to be 'stellate-oracle 1 binary ...' or 'stellate-oracle 1 text "
            f"...' and is {quoted(line)}; if that is a banner, there is an option to be without, "
            "as octave-cli -q"
        )
    if len(words) < 3 or words[2] not in ("binary", "text"):
        raise Garbled(
            f"its first line has to say 'binary' or 'text' in third place: {quoted(line)}"
        )
    if words[1] != "1":
        raise Garbled(f"it speaks version {quoted(words[1])} of the pipe; here it is version 1")
    greeting = Greeting(words[2] == "text")
    for i, word in enumerate(words[3:], 3):
        if word.startswith("about="):
            greeting.about = " ".join(words[i:]).partition("=")[2]
            break
        _understand(word, greeting)
    return greeting


_NUMBERS = {"k": "dimension", "d": "ambient_dimension"}


def _understand(word: str, greeting: Greeting) -> None:
    key, _, value = word.partition("=")
    try:
        if key in _NUMBERS:
            setattr(greeting, _NUMBERS[key], _number(word, value, _MOST_DIMENSIONS))
        elif key in ("tangents", "flats", "sizes"):
            setattr(greeting, key, _number(word, value, 1) != 0)
        elif key == "walls":
            greeting.walls = _number(word, value, _MOST_WALLS)
        elif key == "box":
            greeting.box = parse_box(value)
        elif key == "seeds":
            greeting.seeds = parse_points(value)
        else:
            raise Garbled(
                f"its first line: {quoted(word)} is none of k= d= tangents= flats= sizes= walls= "
                "box= seeds= about="
            )
    except InvalidArgument as error:
        raise Garbled(f"its first line: {error}") from None


def _number(word: str, value: str, most: int) -> int:
    if not (value.isascii() and value.isdigit() and int(value) <= most):
        raise Garbled(f"its first line: {quoted(word)} has to be a whole number up to {most}")
    return int(value)
