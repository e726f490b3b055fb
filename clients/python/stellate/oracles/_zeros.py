"""Why solvers find no zeros of a user's equations, or not the right ones, where that can be told in words."""

from __future__ import annotations

import numpy as np

from .._equations import Equations
from .._rows import Array, Flags, norms
from ..errors import OracleError
from ._nearest import normal_step

_LOOKS = 64  # points that F is looked at from where none leads to M
_FEW = 0.25  # of the first batch, fewer of which find M where something is wrong with F
_ZERO = 1e-6  # of what F is usually, where solvers that find no zero come to one
_FLAT = 1e-2  # of how steep F is usually, where it may be flat
# Steps of Newton's near a zero, by differences over a share of the last one. One leaves next to nothing
# of F where it is not flat, and of a p-th power (1 - 1/p)^p, from 0.25 on.
_POLISHES, _OVER, _LEFT = 60, 1e-3, 0.05
_UNLIKE = 0.5  # share of a Jacobian
_AROUND = (1e-3, 1e-5, 1e-7, 1e-9)  # of the box, how far around a zero a sign is looked for
# Halvings of a line between two signs, and the last ends' distance in shares of it. What values differ by
# there is, in that of their difference over a further one, as much where f is steep without end.
_HALVINGS, _NEXT, _WIDER, _STEEP = 40, 1e-12, 1e-6, 1e-4
_PAIRS = 4  # of two signs
_SAME = 1e-6  # the sine of an angle between gradients of equations that say the same
# Batches with points that are not found in which derivatives are looked at, and points of each.
_BATCHES, _POINTS = 8, 16
_STEP = 1e-6  # of the box, of the differences beside which they are put
_ROUNDED = 64  # times the rounding of F, at the most what a value errs by
_OFF, _TIMES_BENT = (
    1e-3,
    10,
)  # share of a gradient, and times what differences of both sides are apart


class Doubts:
    """Looks at equations where points of them are not found, and says what is wrong with them."""

    def __init__(self, equations: Equations, lower: Array, upper: Array) -> None:
        self._equations, self._lower, self._upper = equations, lower, upper
        self._scale = float(np.linalg.norm(upper - lower))
        self._looked, self._batches = False, _BATCHES

    def consider(self, y: Array, converged: Flags) -> None:
        """After each batch: where its answers (n, d) were found, or given up.

        Raises: OracleError.
        """
        if not len(y):
            return
        if not converged.all() and self._batches > 0:
            self._batches -= 1
            self._insist_on_derivatives(y[~converged][:_POINTS])
        if self._looked:
            return
        if converged.mean() < _FEW or self._keeps_a_sign(y[converged][:1]).any():
            self._insist_on_zeros()
        self._looked = True

    def _insist_on_derivatives(self, at: Array) -> None:
        """Raises: OracleError where a Jacobian that was given is not that of F's differences.

        Where these differ by side, F has a crease or an end, and nobody is accused.
        """
        f, given = self._equations.functions
        at = at[np.isfinite(at).all(axis=1)]
        if given is None or not len(at):
            return
        d, step = at.shape[1], _STEP * self._scale
        steps = step * np.concatenate([np.zeros((1, d)), np.eye(d), -np.eye(d)])
        around = at[:, None, :] + steps
        values = f(around.reshape(-1, d)).reshape(len(at), 2 * d + 1, -1).transpose(0, 2, 1)
        ahead = (values[:, :, 1 : d + 1] - values[:, :, :1]) / step
        behind = (values[:, :, :1] - values[:, :, d + 1 :]) / step
        seen, said = (ahead + behind) / 2, given(at)
        with np.errstate(invalid="ignore"):
            bent = norms(ahead - behind)
            off = norms(said - seen)
            usual = norms(seen)
            # Where F hardly changes over the step its rounding is all that differences show.
            rounding = _ROUNDED * np.finfo(float).eps * np.abs(values).max(axis=2) / step
            told = np.isfinite(usual) & (_OFF * usual > rounding) & (bent <= _OFF * usual)
            wrong = told & ~(off <= np.maximum(_OFF * usual, _TIMES_BENT * bent))
        rows, some = wrong.any(axis=1), told.any(axis=1)
        if not rows.any() or rows.sum() < some.sum() / 2:
            return
        row = int(np.flatnonzero(rows)[0])
        number = int(np.flatnonzero(wrong[row])[0])
        which = "" if said.shape[1] == 1 else f" for f's value {number}"
        raise OracleError(
            f"jacobian is not f's derivative, as near {at[row].tolist()}: it says "
            f"{_listed(said[row, number])}{which}, and differences of f say {_listed(seen[row, number])}. Look "
            "at its signs, its factors and the order of its axes; or leave it out, and differences of f are taken",
            "ORACLE_DERIVATIVE",
        )

    def _keeps_a_sign(self, zeros: Array) -> Flags:
        """(1, d) or (0, d) -> which of F's values have one sign around there, none without a point."""
        random = np.random.default_rng(2)
        d = len(self._lower)
        kept = np.full(self._equations.shape[0], len(zeros) > 0)
        for share in _AROUND:
            if not kept.any():
                break
            away = share * self._scale * random.standard_normal((_LOOKS, d))
            signs = np.sign(self._equations.values((zeros[:, None, :] + away).reshape(-1, d)))
            kept &= (signs >= 0).all(axis=0) | (signs <= 0).all(axis=0)
        return kept

    def _insist_on_zeros(self) -> None:
        """Raises: OracleError where F comes down to zero from wherever it begins, and is flat there, or
        passes it without being it."""
        lower, upper = self._lower, self._upper
        random = np.random.default_rng(1)
        starts = lower + random.random((_LOOKS, len(lower))) * (upper - lower)
        values = self._equations.values(starts)
        if not np.isfinite(values).all(axis=1).any():
            raise OracleError(
                f"f is not finite at any of {_LOOKS} places of its box, nor of its seeds: at "
                f"{starts[0].tolist()} it is {values[0].tolist()}. Is the box "
                "where f is defined, and in its unit?",
                "ORACLE_NOT_FINITE",
            )
        self._insist_on_equations_of_their_own(starts)
        changes = values.shape[1] == 1 and self._changes_sign(starts, values[:, 0])
        self._insist_on_passing_zero(starts, np.abs(values), changes)

    def _insist_on_equations_of_their_own(self, starts: Array) -> None:
        """Raises: OracleError where one of several follows from the others wherever it is looked at."""
        slopes = self._equations.jacobian(starts)
        if slopes.shape[1] == 1:
            return
        with np.errstate(invalid="ignore", divide="ignore"):
            slopes = slopes / norms(slopes)[:, :, None]
        slopes = slopes[np.isfinite(slopes).all(axis=(1, 2))]
        if len(slopes) and (np.linalg.svd(slopes, compute_uv=False)[:, -1] < _SAME).all():
            raise OracleError(
                f"the {slopes.shape[1]} values of f are not independent: their gradients are linearly dependent "
                f"at each of {len(slopes)} places of the box, as near {starts[0].tolist()}. Give equations none "
                "of which follows from the others, d - k of them"
            )

    def _changes_sign(self, starts: Array, values: Array) -> bool:
        """Whether f is above and below zero. Raises: OracleError where it jumps from one to the other."""
        high, low = starts[values > 0][:_PAIRS], starts[values < 0][:_PAIRS]
        count = min(len(high), len(low))
        if not count:
            return False
        low, high = low[:count], high[:count]
        way = high - low
        left, right = np.zeros(count), np.ones(count)
        for _ in range(_HALVINGS):
            middle = (left + right) / 2
            above = self._equations.values(low + middle[:, None] * way)[:, 0] > 0
            left, right = np.where(above, left, middle), np.where(above, middle, right)

        ends = np.stack(
            [left - _WIDER / 2, left - _NEXT / 2, right + _NEXT / 2, right + _WIDER / 2]
        )
        seen = self._equations.values((low + ends[:, :, None] * way).reshape(-1, low.shape[1]))
        far_below, below, over, far_over = seen.reshape(4, count)
        with np.errstate(invalid="ignore"):
            steep = over - below > _STEEP * np.abs(far_over - far_below)
        if steep.all():
            place = (low + left[:, None] * way)[0].tolist()
            raise OracleError(
                f"f passes zero without being zero, or is steep without end there, near {place}: it is "
                f"{below[0]:.6g} on the one side and {over[0]:.6g} on the other, {_NEXT:g} of the way across "
                "the box apart. A comparison, a sign, a label, a quotient or a root is no equation of a smooth "
                "manifold: give the number that is compared, what the root is taken of, or the like",
                "ORACLE_PRECISION",
            )
        return True

    def _insist_on_passing_zero(self, starts: Array, before: Array, changes: bool) -> None:
        """Raises: OracleError where |F|, which is `before` at the starts, has its zeros where it is least, or
        flat. `changes`: its one value is known to change its sign."""
        y, values = self._equations.drive(starts, normal_step)[:2]
        with np.errstate(invalid="ignore"):
            beyond = np.maximum(self._lower - y, y - self._upper).max(axis=1) > self._scale / 2
        usable = np.isfinite(values).all(axis=1) & ~beyond
        least = np.abs(values) <= _ZERO * np.nanmedian(before, axis=0)
        if not usable.any() or not least[usable].all(axis=1).mean() > 0.5:
            return  # where F is zero is found, or it is zero nowhere
        near = y[int(np.flatnonzero(usable & least.all(axis=1))[0])]
        zero, slopes = self._polished(near)
        kept = self._keeps_a_sign(zero[None]) & (not changes)
        for number, keeps in enumerate(kept):
            if keeps:
                which = "f" if len(kept) == 1 else f"f's value {number}"
                raise OracleError(
                    f"{which} touches zero without changing its sign, as near {zero.tolist()}: |f| is "
                    "least there, as a square is, or a distance without a sign, and its gradient is zero "
                    "or has none. Give what is squared, or a signed distance",
                    "ORACLE_TOUCHES_ZERO",
                )
        steep = [np.abs(self._equations.jacobian(x)).max(axis=(1, 2)) for x in (starts, y[usable])]
        if not np.nanmedian(steep[1]) <= _FLAT * np.nanmedian(steep[0]):
            return
        if slopes is not None:  # F is steeper elsewhere, as in a box that is far too large
            self._insist_on_differences(zero, slopes)
            return
        raise OracleError(
            f"f is flat where it is zero, as near {zero.tolist()}: its gradient vanishes with it, as a "
            "cube's does. Give what is raised to a power",
            "ORACLE_TOUCHES_ZERO",
        )

    def _insist_on_differences(self, zero: Array, slopes: Array) -> None:
        """Raises: OracleError where F's Jacobian at a point (d,) is not what it is seen to be, (m, d), as
        the differences that are a share of the box are longer than M is large."""
        known = self._equations.jacobian(zero[None])[0]
        if np.abs(known - slopes).max() <= _UNLIKE * np.abs(slopes).max():
            return
        raise OracleError(
            f"the box is far too large: f is zero near {zero.tolist()}, where differences of f over a share of the "
            f"box, which is {self._scale:.6g} across, are not its derivatives. Give a box that holds the manifold "
            "more closely, a thousand times its size at most",
            "ORACLE_DERIVATIVE",
        )

    def _polished(self, zero: Array) -> tuple[Array, Array | None]:
        """(d,), which may be as far off as a box that is far too large allows -> a zero near it, and
        F's Jacobian there (m, d), or None where F is flat."""
        d = len(zero)
        step, least = _ZERO * self._scale, 1e-13 * float(np.abs(zero).max())
        for _ in range(_POLISHES):
            h = max(_OVER * step, least)
            around = zero + h * np.concatenate([np.zeros((1, d)), np.eye(d), -np.eye(d)])
            values = self._equations.values(around)
            slopes = (values[1 : d + 1] - values[d + 1 :]).T / (2 * h)
            if not np.isfinite(slopes).all() or not values[0].any():
                break
            way = np.linalg.pinv(slopes, rcond=1e-14) @ values[0]
            step = float(np.linalg.norm(way))
            left = np.abs(self._equations.values((zero - way)[None])[0]).max()
            if not left < np.abs(values[0]).max():
                break
            zero = zero - way
            if left <= _LEFT * np.abs(values[0]).max():
                return zero, slopes
        return zero, None


def _listed(row: Array) -> str:
    """As many digits as differences have; without brackets, as it is no place."""
    return ", ".join(f"{x:.6g}" for x in row)
