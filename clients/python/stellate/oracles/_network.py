"""Level sets of trained networks, and of any functions that bring their gradients along."""

from __future__ import annotations

import copy
import sys
import threading
from collections.abc import Callable
from typing import Any

import numpy as np

from .._derivatives import with_derivatives
from .._rows import Array
from ..errors import InvalidArgument, OracleError
from ._implicit import ImplicitManifold

_ROWS = 256  # asked at a time: always this number, whatever the batch


class NeuralImplicit(ImplicitManifold):
    """The set where a network has a level, in R^d.

    Args:
      network: a torch.nn.Module from (n, d) to (n,) or (n, m), of which a copy in double precision is
        taken; or any callable (n, d) -> (values (n,) or (n, m), gradients (n, d) or (n, m, d)) of
        numpy arrays in double precision.
      bounding_box: (lower (d,), upper (d,)) around the set.
      level: a number, or m of them.
      thread_safe: the network may be called by several threads at once.

    With m values the set has dimension d - m. The network has to be smooth near the set: softplus,
    tanh and sin are, ReLU makes kinks, which the doctor tells. It is asked in blocks of 256 points,
    the last one filled up, since products of matrices round a row by how many there are beside it.
    """

    def __init__(
        self,
        network: Any,
        *,
        bounding_box: Any,
        level: Any = 0.0,
        thread_safe: bool = False,
    ) -> None:
        if not callable(network):
            raise InvalidArgument(f"a network has to be callable, and is {network!r}")
        try:
            d = len(bounding_box[0])
            probe = (np.asarray(bounding_box[0], float) + np.asarray(bounding_box[1], float))[None]
        except (TypeError, IndexError, ValueError):
            raise InvalidArgument(
                f"bounding_box has to be a pair of corners, and is {bounding_box!r}"
            ) from None
        both = _of_module(network) if _is_module(network) else network
        self._both, self._level = both, np.asarray(level, dtype=np.float64)
        self._last = _Last()
        count = self._at(probe / 2)[0].shape[1]
        if self._level.shape not in ((), (count,)):
            raise InvalidArgument(f"the network has {count} values, and level is {level!r}")
        super().__init__(
            self._values,
            self._gradients,
            ambient_dimension=d,
            dimension=d - count,
            bounding_box=bounding_box,
            thread_safe=thread_safe,
        )

    def _values(self, x: Array) -> Array:
        return np.asarray(self._at(x)[0] - self._level)

    def _gradients(self, x: Array) -> Array:
        return self._at(x)[1]

    def _at(self, x: Array) -> tuple[Array, Array]:
        """Values (n, m) and gradients (n, m, d); those of the last batch are kept, since solvers ask
        for one after the other."""
        last = self._last.batch
        if last is not None and np.array_equal(last[0], x):
            return last[1], last[2]
        padded = np.concatenate([x, np.repeat(x[-1:], -len(x) % _ROWS, axis=0)])
        blocks = [_checked(self._both(padded[i : i + _ROWS])) for i in range(0, len(padded), _ROWS)]
        if not blocks:
            blocks = [_checked(self._both(np.zeros((_ROWS, x.shape[1]))))]
        values, gradients = (np.concatenate(parts)[: len(x)] for parts in zip(*blocks))
        self._last.batch = x.copy(), values, gradients
        return values, gradients


class _Last(threading.local):
    """The batch that a thread asked about last. Another process has none."""

    batch: tuple[Array, Array, Array] | None = None

    def __reduce__(self) -> tuple[type[_Last], tuple[()]]:
        return _Last, ()


def _checked(answer: Any) -> tuple[Array, Array]:
    """Values (n, m) and gradients (n, m, d) in double precision. Raises: OracleError."""
    if not isinstance(answer, tuple) or len(answer) != 2:
        raise OracleError(
            f"a network has to return the pair (values, gradients), and returned a "
            f"{type(answer).__name__}",
            "ORACLE_SHAPE",
        )
    values, gradients = (np.asarray(part) for part in answer)
    values = values[:, None] if values.ndim == 1 else values
    gradients = gradients[:, None, :] if gradients.ndim == 2 else gradients
    if values.ndim != 2 or gradients.ndim != 3 or gradients.shape[:2] != values.shape:
        raise OracleError(
            "a network has to return values (n, m) and gradients (n, m, d), and returned "
            f"{np.shape(answer[0])} and {np.shape(answer[1])}",
            "ORACLE_SHAPE",
        )
    if values.dtype != np.float64 or gradients.dtype != np.float64:
        raise OracleError(
            f"a network has to answer in double precision, and answered in {values.dtype} and "
            f"{gradients.dtype}: closest points have to be found to more digits than single has",
            "ORACLE_PRECISION",
        )
    return values, gradients


def _is_module(network: Any) -> bool:
    torch: Any = sys.modules.get("torch")  # whoever made a module has imported it
    return hasattr(torch, "nn") and isinstance(network, torch.nn.Module)


def _of_module(network: Any) -> Callable[[Array], tuple[Array, Array]]:
    """Values and gradients of a copy in double precision, which nobody trains on."""
    double = copy.deepcopy(network).double().eval()
    for parameter in double.parameters():
        parameter.requires_grad_(False)

    values, gradients = with_derivatives(_Columns(double), "torch")
    return _Both(values, gradients)


class _Columns:
    def __init__(self, network: Any) -> None:
        self._network = network

    def __call__(self, x: Any) -> Any:
        values = self._network(x)
        return values[:, None] if values.ndim == 1 else values


class _Both:
    def __init__(
        self, values: Callable[[Array], Array], gradients: Callable[[Array], Array]
    ) -> None:
        self._values, self._gradients = values, gradients

    def __call__(self, x: Array) -> tuple[Array, Array]:
        return self._values(x), self._gradients(x)
