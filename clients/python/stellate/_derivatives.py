"""Functions that give their own derivatives: written for autograd, jax or torch.

None of these is needed by the package; each is imported when it is asked for.
"""

from __future__ import annotations

from typing import Any, Callable, Literal

import numpy as np

from .errors import InvalidArgument

_ROWS = 128  # that jax compiles a function for; batches come in all sizes

Library = Literal["autograd", "jax", "torch"]
Batched = Callable[[np.ndarray], np.ndarray]
# An array of the library's -> F there, and what makes of (n, m) weights the (n, d) gradient of
# their sum over F.
Differentiate = Callable[[Any], "tuple[Any, Callable[[Any], Any]]"]


def with_derivatives(f: Callable[[Any], Any], library: Library) -> tuple[Batched, Batched]:
    """f and its Jacobian, both from arrays of numpy's to such arrays.

    Row i of f(x) depends on row i of x alone: the gradient of a sum over all rows has those of all.

    Raises: InvalidArgument for a library that is not known or not installed.
    """
    if library not in _MAKERS:
        raise InvalidArgument(
            f"jacobian has to be a function, None for differences, or one of "
            f"{', '.join(map(repr, _MAKERS))}, and is {library!r}"
        )
    try:
        both = _Derived(f, library)
        return both.values, both.jacobian
    except ImportError as error:
        raise InvalidArgument(
            f"jacobian={library!r} needs {library}, which cannot be imported ({error}): install "
            "it, or leave jacobian out for differences"
        ) from None


class _Derived:
    """What a library makes of f; another process has it made again."""

    def __init__(self, f: Callable[[Any], Any], library: Library) -> None:
        self._made_of = f, library
        self._values, self._jacobian = _MAKERS[library](f)

    def values(self, x: np.ndarray) -> np.ndarray:
        return self._values(x)

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        return self._jacobian(x)

    def __reduce__(self) -> tuple[Any, ...]:
        return _Derived, self._made_of


def _gradients(differentiate: Differentiate, x: Any, array: Callable[[Any], Any]) -> list[Any]:
    """The (n, d) gradients of F's m components. `array` makes the library's arrays."""
    values, gradient = differentiate(x)
    rows = []
    for component in range(values.shape[1]):
        weights = np.zeros(values.shape)
        weights[:, component] = 1.0
        rows.append(gradient(array(weights)))
    return rows


def _autograd(f: Callable[[Any], Any]) -> tuple[Batched, Batched]:
    from autograd import make_vjp

    def differentiate(x: np.ndarray) -> tuple[Any, Callable[[Any], Any]]:
        gradient, values = make_vjp(f)(x)
        return values, gradient

    def jacobian(x: np.ndarray) -> np.ndarray:
        return np.stack(_gradients(differentiate, x, np.asarray), axis=1)

    return f, jacobian


def _torch(f: Callable[[Any], Any]) -> tuple[Batched, Batched]:
    import torch

    def differentiate(x: Any) -> tuple[Any, Callable[[Any], Any]]:
        with torch.enable_grad():
            values = f(x)
        return values, lambda weights: torch.autograd.grad(
            values, x, weights, retain_graph=True, allow_unused=True
        )[0]

    def values(x: np.ndarray) -> np.ndarray:
        return f(torch.tensor(x)).detach().numpy()

    def jacobian(x: np.ndarray) -> np.ndarray:
        point = torch.tensor(x, requires_grad=True)
        rows = _gradients(differentiate, point, torch.tensor)
        # None: a component that does not depend on x at all.
        return np.stack([np.zeros(x.shape) if g is None else g.numpy() for g in rows], axis=1)

    return values, jacobian


def _jax(f: Callable[[Any], Any]) -> tuple[Batched, Batched]:
    import jax

    try:
        from jax.experimental import enable_x64
    except ImportError:  # where later versions have it
        enable_x64 = jax.enable_x64

    def differentiate(x: Any) -> tuple[Any, Callable[[Any], Any]]:
        values, pull_back = jax.vjp(f, x)
        return values, lambda weights: pull_back(weights)[0]

    def all_rows(x: Any) -> Any:
        return jax.numpy.stack(_gradients(differentiate, x, jax.numpy.asarray), axis=1)

    def in_blocks(compiled: Callable[[Any], Any]) -> Batched:
        def answer(x: np.ndarray) -> np.ndarray:
            padding = -len(x) % _ROWS
            padded = np.concatenate([x, np.repeat(x[-1:], padding, axis=0)])
            with enable_x64(True):  # jax takes single precision else
                parts = [
                    np.asarray(compiled(padded[i : i + _ROWS]))
                    for i in range(0, len(padded), _ROWS)
                ]
            return np.concatenate([part[: len(x) - i * _ROWS] for i, part in enumerate(parts)])

        return answer

    return in_blocks(jax.jit(f)), in_blocks(jax.jit(all_rows))


_MAKERS = {"autograd": _autograd, "jax": _jax, "torch": _torch}
