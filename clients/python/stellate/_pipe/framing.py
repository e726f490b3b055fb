"""What goes through the pipe, as bytes; docs/using/pipe.md is its specification."""

from __future__ import annotations

import dataclasses
import itertools
import struct
from typing import Any

import numpy as np

from .greeting import Garbled, quoted

MOST_ERROR_BYTES = 1 << 16
_TANGENTS, _SIZES, _FOUND, _ERROR, _WALLS = 1, 2, 4, 8, 16


class CommandError(Exception):
    """An error in the command's own words."""


@dataclasses.dataclass
class Question:
    """A batch: flats where bases are given, points of a face where that is, else closest points."""

    dimension: int  # k
    points: np.ndarray  # (n, d); of flats, their centers
    bases: np.ndarray | None = None  # (n, d, k)
    radii: np.ndarray | None = None  # (n,)
    tangents: bool = False  # wanted beside the points
    sizes: bool = False
    walls: int = 0  # of the oracle, whose clearances are wanted too
    face: tuple[int, ...] = ()

    @property
    def wall_numbers(self) -> int:
        """That an answer has for each point, of walls."""
        return self.walls + len(self.face) * self.points.shape[1]

    def to_bytes(self, text: bool) -> bytes:
        """As the command reads it."""
        parts = [self.points]
        if self.bases is not None and self.radii is not None:
            parts += [self.bases.reshape(len(self.points), -1), self.radii[:, None]]
        if not text:
            wanted = self.tangents * _TANGENTS + self.sizes * _SIZES
            kind = 3 if self.face else 1 if self.bases is None else 2
            head = struct.pack("=4I", kind, len(self.points), wanted, len(self.face))
            head += struct.pack(f"={len(self.face)}I", *self.face)
            return head + b"".join(np.ascontiguousarray(part).tobytes() for part in parts)
        name = "face" if self.face else "closest" if self.bases is None else "flat"
        words = [name, len(self.points), int(self.tangents), int(self.sizes), *self.face]
        head = (" ".join(map(str, words)) + "\n").encode()
        rows = np.concatenate(parts, axis=1).tolist()
        return head + "".join(" ".join(map(_decimal, row)) + "\n" for row in rows).encode()


def _decimal(number: float) -> str:
    """Exact, and without an exponent, which bc does not take."""
    text = repr(number)
    return np.format_float_positional(number, trim="-") if "e" in text else text


@dataclasses.dataclass
class Answer:
    points: np.ndarray  # (n, d)
    found: np.ndarray  # (n,) bool
    tangents: np.ndarray | None = None  # (n, d, k)
    sizes: np.ndarray | None = None  # (n,)
    clearances: np.ndarray | None = None  # (n, walls)
    conormals: np.ndarray | None = None  # (n, len(face), d)


class AnswerReader:
    """Reads the answer to one question, in whatever pieces it comes."""

    def __init__(self, question: Question) -> None:
        self._question = question
        self._n, self._d = question.points.shape
        self._dk = self._d * question.dimension

    def take(self, came: bytearray) -> bool:
        """Takes from the front of what came. True once the answer is whole; what is left then came
        after it. Raises: Garbled, CommandError."""
        raise NotImplementedError

    def finish(self) -> Answer:
        """After take said True: what the question wanted, finite wherever found. Raises: Garbled."""
        answer = self._read()
        n, d, k = self._n, self._d, self._question.dimension
        if not self._question.tangents:
            answer.tangents = None
        elif answer.tangents is None:
            if answer.found.any():
                raise _promised("tangents")
            answer.tangents = np.zeros((n, d, k))
        if not self._question.sizes:
            answer.sizes = None
        elif answer.sizes is None:
            if answer.found.any():
                raise _promised("sizes")
            answer.sizes = np.ones(n)
        if self._question.walls and answer.clearances is None:
            if answer.found.any():
                raise _promised("walls")
            answer.clearances = np.zeros((n, self._question.walls))
            answer.conormals = np.zeros((n, len(self._question.face), d))
        for what, values in (
            ("a point", answer.points),
            ("tangents", answer.tangents),
            ("a size", answer.sizes),
            ("a clearance", answer.clearances),
            ("a conormal", answer.conormals),
        ):
            if values is not None and values.size:
                self._insist_on_finite(what, values.reshape(n, -1), answer)
        return answer

    def _read(self) -> Answer:
        raise NotImplementedError

    def _insist_on_finite(self, what: str, values: np.ndarray, answer: Answer) -> None:
        bad = answer.found & ~np.isfinite(values).all(axis=1)
        if bad.any():
            row = int(np.argmax(bad))
            raise Garbled(
                f"{self._row(row)} has {what} that is not finite, and does not say that none was "
                f"found: {_show(answer.points[row])} for the query "
                f"{_show(self._question.points[row])}"
            )

    def _row(self, row: int) -> str:
        return f"row {row + 1} of {self._n}"


def _promised(what: str) -> Garbled:
    return Garbled(f"it has no {what} in an answer that has to have them: its first line promised")


def _show(numbers: np.ndarray) -> str:
    more = ", ...)" if len(numbers) > 10 else ")"
    return "(" + ", ".join(f"{number:.17g}" for number in numbers[:10]) + more


class BinaryReader(AnswerReader):
    def __init__(self, question: Question) -> None:
        super().__init__(question)
        self._flags: int | None = None
        self._size = 0  # of the body, in bytes
        self._body = b""

    def take(self, came: bytearray) -> bool:
        if self._flags is None:
            if len(came) < 8:
                return False
            self._begin(came)
            del came[:8]
        if len(came) < self._size:
            return False
        self._body = bytes(came[: self._size])
        del came[: self._size]
        if self._flags == _ERROR:
            raise CommandError(self._body.decode(errors="replace"))
        return True

    def _begin(self, came: bytearray) -> None:
        count, flags = struct.unpack_from("=2I", came)
        if flags == _ERROR and count <= MOST_ERROR_BYTES:
            self._size = count
        elif flags & _ERROR or flags > _WALLS + _FOUND + _SIZES + _TANGENTS:
            raise Garbled(
                "an answer begins with its number of rows and its flags, 8 bytes; these are "
                f"{quoted(came)}; does something else write to its standard output?"
            )
        elif count != self._n:
            raise Garbled(f"it answers {count} rows and was asked {self._n}")
        else:
            numbers = self._d + (self._dk if flags & _TANGENTS else 0) + bool(flags & _SIZES)
            numbers += self._question.wall_numbers if flags & _WALLS else 0
            self._size = self._n * (8 * numbers + bool(flags & _FOUND))
        self._flags = flags

    def _read(self) -> Answer:
        at = 0

        def numbers(*shape: int) -> np.ndarray:
            nonlocal at
            values = np.frombuffer(self._body, np.float64, int(np.prod(shape)), at)
            at += values.nbytes
            return values.reshape(shape)

        flags, n, d = self._flags or 0, self._n, self._d
        answer = Answer(numbers(n, d), np.ones(n, dtype=bool))
        if flags & _TANGENTS:
            answer.tangents = numbers(n, d, self._question.dimension)
        if flags & _SIZES:
            answer.sizes = numbers(n)
        if flags & _WALLS and self._question.walls:
            face = len(self._question.face)
            answer.clearances = numbers(n, self._question.walls)
            answer.conormals = numbers(n, face, d)
        if flags & _FOUND:
            found = np.frombuffer(self._body, np.uint8, n, at)
            if (found > 1).any():
                row = int(np.argmax(found > 1))
                raise Garbled(f"{self._row(row)} has {found[row]} for found, which is 0 or 1")
            answer.found = found.astype(bool)
        return answer


class TextReader(AnswerReader):
    def __init__(self, question: Question) -> None:
        super().__init__(question)
        self._lines: list[bytes] = []
        # Numbers of a row have some 25 bytes each, and never more than 400.
        numbers = self._d + self._dk + 1 + question.wall_numbers
        self._longest = max(MOST_ERROR_BYTES, 400 * numbers)

    def take(self, came: bytearray) -> bool:
        end = came.rfind(b"\n") + 1
        lines = bytes(came[:end]).split(b"\n")[:-1]
        wanted = self._n - len(self._lines)
        if len(lines) > wanted:
            end = sum(len(line) + 1 for line in lines[:wanted])
            del lines[wanted:]
        for row, line in enumerate(lines, len(self._lines)):
            if line.lstrip().startswith(b"error"):
                raise CommandError(line[:MOST_ERROR_BYTES].strip().decode(errors="replace"))
            if len(line) > self._longest:
                raise Garbled(f"{self._row(row)} is too long: {quoted(line)}")
        self._lines += lines
        del came[:end]
        if len(self._lines) < self._n and len(came) > self._longest:
            raise Garbled(f"{self._row(len(self._lines))} does not end: {quoted(came)}")
        return len(self._lines) == self._n

    def _read(self) -> Answer:
        n, d, dk = self._n, self._d, self._dk
        rows = [line.split() for line in self._lines]
        found = np.array([row != [b"-"] for row in rows], dtype=bool)
        counts = np.array([len(row) for row in rows])
        of_walls = self._question.wall_numbers
        width = int(counts[found][0]) if found.any() else d + of_walls
        self._check(counts, found, width)
        values = np.zeros((n, width))
        values[found] = self._numbers(rows, found).reshape(-1, width)
        columns = width - of_walls
        answer = Answer(values[:, :d], found)
        if self._question.walls:
            after = values[:, columns:]
            answer.clearances = after[:, : self._question.walls]
            answer.conormals = after[:, self._question.walls :].reshape(n, -1, d)
        if columns >= d + dk:
            answer.tangents = values[:, d : d + dk].reshape(n, d, -1)
        if columns in (d + 1, d + dk + 1):
            answer.sizes = np.where(found, values[:, columns - 1], 1.0)
        return answer

    def _check(self, counts: np.ndarray, found: np.ndarray, columns: int) -> None:
        d, dk, of_walls = self._d, self._dk, self._question.wall_numbers
        wrong = found & (counts != columns)
        if columns - of_walls not in (d, d + 1, d + dk, d + dk + 1):
            row = int(np.argmax(found))
            why = f", not {d} of a point, {dk} more of tangents or 1 more of a size"
            why += f", and {of_walls} of walls after these" if of_walls else ""
        elif wrong.any():
            row = int(np.argmax(wrong))
            why = f", and those before {columns}"
        else:
            return
        line = quoted(self._lines[row])
        raise Garbled(f"{self._row(row)} has {counts[row]} numbers{why}: {line}")

    def _numbers(self, rows: list[list[bytes]], found: np.ndarray) -> np.ndarray:
        words: list[Any] = list(itertools.chain.from_iterable(itertools.compress(rows, found)))
        try:
            return np.array(list(map(float, words)))
        except ValueError:
            pass
        for row in np.flatnonzero(found):
            for word in rows[row]:
                try:
                    float(word)
                except ValueError:
                    raise Garbled(f"{self._row(row)} has {quoted(word)} for a number") from None
        raise AssertionError


def reader(question: Question, text: bool) -> AnswerReader:
    return TextReader(question) if text else BinaryReader(question)
