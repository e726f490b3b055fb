"""Functions that users write, for whole batches: how they are called, and what they may return."""

from __future__ import annotations

from typing import Any, Callable

import numpy as np

from ._rows import unmasked
from .errors import OracleError, StellateError, add_words

_LINES = 12  # that the exactness of a function is measured along
_FEWEST = 3  # of them that have to tell it
# Of a line's five places, in shares of the box: no smooth function bends in the first. Single
# precision far from the origin does not tell them apart: then those of the second length, in which a
# spline does bend, where its pieces meet.
_STEPS = (1e-6, 1e-4)
_FOURTH = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # their fourth difference, of what is not smooth:
_FOURTH_SIZE = np.sqrt(70.0)  # so many times the error of a value
# The most that values may err by, as a length in shares of the box: a hundred times what points are
# found to. Single precision errs by some 1e-8, double by 1e-16.
_INEXACT = 1e-10
# An error of no more than this share of a value is its own rounding: next to a level, where values are
# small, it is not there. Densities far from what they are dense in are flat, and all but the level.
_OWN_ROUNDING = 16 * float(np.finfo(float).eps)
_ROUNDINGS = 1600 * float(np.finfo(float).eps)  # likewise, of the largest coordinate


class UserFunction:
    """A function of a user's, which is checked.

    Shapes without the batch are called rows. An answer of another shape, in single precision or in
    whole numbers is an OracleError that says what is right. An exception of the function's own goes on
    as it is; until it has answered once, words on how it is called are added. Its argument is a copy:
    what it does there does not reach the solvers, which go on with theirs.

    Args:
      f: (n, *asked) -> (n, *row); of one number a row (n,) and (n, 1) are the same.
      name: of the function, for messages.
      asked: letters for what a row of its argument has, such as "d".
      row: the shape of a row of its values, whose whole numbers are insisted on; a letter stands for
        any, and is replaced by what the first answer has.
      why: a row has to have that shape, for messages.
    """

    def __init__(
        self,
        f: Callable[[Any], Any],
        name: str,
        row: tuple[int | str, ...],
        asked: str = "d",
        why: str = "",
    ) -> None:
        self._f, self.name, self._asked, self.row, self._why = f, name, asked, row, why
        self._worked = False

    @property
    def width(self) -> int:
        """How many numbers the first axis of a row has. 1 until it is known."""
        return self.row[0] if self.row and isinstance(self.row[0], int) else 1

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """At the rows of x, without asking if there are none. Raises: OracleError."""
        if not len(x):
            return np.empty((0, *(1 if isinstance(n, str) else n for n in self.row)))
        if self._worked:
            return self._checked(self._f(x.copy()), x.shape)
        try:
            answer = self._f(x.copy())
        except StellateError:
            raise
        except Exception as error:
            add_words(error, self._called(x.shape))
            raise
        values = self._checked(answer, x.shape)
        self.row, self._worked = values.shape[1:], True
        return values

    def _called(self, shape: tuple[int, ...]) -> str:
        one = f" or {_shape('n', *self.row[:-1])}" if self.row[-1:] == (1,) else ""
        return (
            f"{self.name} is called with a whole batch, an array (n, {self._asked}), here "
            f"{shape}, and returns {_shape('n', *self.row)}{one}, a row for each of its rows: "
            f"x[:, 0] are all first coordinates, x[0] is the first point{self._why}"
        )

    def _checked(self, answer: Any, asked: tuple[int, ...]) -> np.ndarray:
        values, count = np.asarray(unmasked(answer)), asked[0]
        real = values.dtype.kind in "fiu"
        if real and self._lacks_an_axis(values.shape, count):
            values = values[:, None]
        fits = len(values.shape) == 1 + len(self.row) and all(
            isinstance(wanted, str) or wanted == got
            for wanted, got in zip((count, *self.row), values.shape)
        )
        if not fits or not real:
            got = f"shape {values.shape}" if real else _kind(answer, values)
            raise OracleError(
                f"{self.name} returned {got}; it has to be {_shape(count, *self.row)} for a batch of "
                f"{count} points, a row each"
                + _likely(values, count, self.row)
                + ("" if self._worked else f"; {self._called(asked)}"),
                "ORACLE_SHAPE",
            )
        if values.dtype.kind == "f" and values.dtype.itemsize < 8:
            raise OracleError(
                f"{self.name} returned {values.dtype} numbers; points are found to twelve digits, "
                "which takes float64 throughout (of a function of jax's say jacobian='jax'; in torch compute "
                "with torch.from_numpy(x) and model.double(), or take oracles.NeuralImplicit)",
                "ORACLE_PRECISION",
            )
        if values.dtype.kind in "iu":
            raise OracleError(
                f"{self.name} returned {values.dtype} numbers; it has to be smooth, and whole numbers "
                "have steps: leave out what rounds, such as astype(int) or //",
                "ORACLE_PRECISION",
            )
        return values.astype(float, copy=False)

    def _lacks_an_axis(self, shape: tuple[int, ...], count: int) -> bool:
        """Of one value: (n,) for (n, 1), its gradient (n, d) for (n, 1, d)."""
        if not self.row or self.row[0] not in (1, "m") or len(shape) != len(self.row):
            return False
        wanted = (count, *self.row[1:])
        return all(isinstance(w, str) or w == got for w, got in zip(wanted, shape))


def _likely(values: np.ndarray, count: int, row: tuple[int | str, ...]) -> str:
    """What is most likely meant by values of another kind or number."""
    if values.dtype.kind == "c":
        return ". Of a complex equation give both parts: np.stack([w.real, w.imag], axis=1)"
    wanted = row[0] if len(row) == 1 else "m"
    if not isinstance(wanted, int) or values.ndim != 2:
        return ""
    if values.shape[0] == count and values.shape[1] > wanted > 1:
        return (
            ". Equations that follow from others, as half of P P = P does, are left out; or write an oracle with "
            "a closest_point, for which matrices have factorisations"
        )
    return ""


class Exactness:
    """Insists, once, that a function is as exact as double precision is.

    Args:
      about: (s, d) places to look from, or None: random ones of the box.
      lower, upper: (d,), the box.
    """

    def __init__(self, about: np.ndarray | None, lower: np.ndarray, upper: np.ndarray) -> None:
        self._about, self._lower, self._upper = _points(about, len(lower)), lower, upper
        self._known = False

    def insist(self, f: UserFunction) -> None:
        """Raises: OracleError, where f rounds to single precision and back, or is as noisy."""
        if self._known:
            return
        self._known = True
        inexact, value = self._share(f)
        sides = np.maximum(self._upper - self._lower, 1e-300)
        far = float((np.maximum(np.abs(self._lower), np.abs(self._upper)) / sides).max())
        if inexact <= max(_INEXACT, _ROUNDINGS * far):
            return
        which = f.name if f.width == 1 else f"{f.name}'s value {value}"
        self._insist_on_one_value(f, which)
        raise OracleError(
            f"{which} is exact to {inexact:.1g} of its box at best, as neighbouring points show, which is "
            "what single precision does. Points are found to twelve digits, which takes "
            "float64 throughout, within the function as well; what is solved or integrated inside it "
            "takes as many digits",
            "ORACLE_PRECISION",
        )

    def _insist_on_one_value(self, f: UserFunction, which: str) -> None:
        """Raises: OracleError, where f of the same points is not always the same."""
        random = np.random.default_rng(2)
        sides = self._upper - self._lower
        x = self._lower + sides * random.random((_LINES, len(sides)))
        first, again = f(x), f(x)
        changed = ~((first == again) | (np.isnan(first) & np.isnan(again))).all(axis=1)
        if not changed.any():
            return
        row = int(np.flatnonzero(changed)[0])
        raise OracleError(
            f"{which} is not a function of the point alone: asked twice at {x[row].tolist()} it returned "
            f"{first[row].tolist()} and {again[row].tolist()}. Fix the seed of what is random in it, and "
            "average before it is meshed, not in each call",
            "ORACLE_PRECISION",
        )

    def _share(self, f: UserFunction) -> tuple[float, int]:
        """How far the zero set moves by the errors of f, in shares of the box; by which of its values.

        Along short lines a smooth function is a straight one, which its fourth differences show no
        more than rounding of.
        """
        random = np.random.default_rng(1)
        d, sides = len(self._lower), self._upper - self._lower
        starts = self._lower + sides * random.random((_LINES, d))
        if self._about is not None:
            starts = self._about[np.arange(_LINES) % len(self._about)]
        ways = random.standard_normal((_LINES, d))
        ways *= sides / np.sqrt((ways * ways).sum(axis=1))[:, None]
        exact = np.zeros(1, dtype=bool)  # values that lines have shown to be
        for step in _STEPS:
            along = step * np.arange(-2, 3)[None, :, None] * ways[:, None, :]
            values = f((starts[:, None, :] + along).reshape(-1, d)).reshape(_LINES, 5, -1)
            with np.errstate(invalid="ignore", divide="ignore"):
                error = np.abs((values * _FOURTH[None, :, None]).sum(axis=1)) / _FOURTH_SIZE
                change = np.abs(values[:, 4] - values[:, 0])
                shares = error * (4 * step) / change
            own = _OWN_ROUNDING * np.abs(values).max(axis=1)
            told = np.isfinite(shares) & (error > own)
            enough = (told.sum(axis=0) >= _FEWEST) & ~exact
            if enough.any():
                usual = [np.median(c[t]) if e else 0.0 for c, t, e in zip(shares.T, told.T, enough)]
                return float(max(usual)), int(np.argmax(usual))
            # Where it changes, and as a straight line does, longer lines would show how it bends.
            exact = exact | (((change > own) & (error <= own)).sum(axis=0) >= _FEWEST)
            if exact.all():
                break
        return 0.0, 0


def _points(about: Any, d: int) -> np.ndarray | None:
    """Seeds, if they are what they have to be, which the server judges."""
    try:
        points = np.asarray(about, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    right = points.ndim == 2 and points.shape[1] == d and len(points) and np.isfinite(points).all()
    return points if right else None


def _kind(answer: Any, values: np.ndarray) -> str:
    """What was returned in place of real numbers."""
    if values.dtype.kind == "c":
        return f"{values.dtype} numbers, where real ones are taken"
    if values.dtype.kind == "b":
        return (
            "truth values, where numbers are taken: give the difference in place of the comparison"
        )
    if isinstance(answer, np.ndarray):
        return f"an array of {values.dtype}, where float64 is taken"
    return type(answer).__name__


def _shape(*sides: Any) -> str:
    return f"({', '.join(map(str, sides))}{',' if len(sides) == 1 else ''})"
