"""Functions written in numpy, run once on symbols, so that their formula is known."""

from __future__ import annotations

from typing import Any, Callable

import numpy as np

from ..errors import InvalidArgument, StellateError, add_words
from ._formulas import SMOOTH, Node, constant, coordinate, make

_COMPARED = {
    "greater": (0, 1), "greater_equal": (0, 1), "less": (1, 0), "less_equal": (1, 0),
}  # fmt: skip
_FOLDS = (
    "mod", "remainder", "fmod", "floor_divide", "divmod", "floor", "ceil", "trunc", "fix", "rint",
    "round", "round_", "around", "modf",
)  # fmt: skip
_SAME = {"true_divide": "divide", "float_power": "power", "fabs": "absolute", "positive": "add"}
_REDUCED = {
    "sum": "add", "prod": "multiply", "max": "maximum", "amax": "maximum", "min": "minimum",
    "amin": "minimum",
}  # fmt: skip
_WHERE = "write numpy.where, numpy.minimum or numpy.maximum"


def formula_of(f: Callable[[Any], Any], d: int) -> Node:
    """What f, (n, d) -> (n,), computes. Raises: InvalidArgument, where that cannot be traced."""
    try:
        result = f(Symbols(_array([coordinate(i) for i in range(d)])))
    except StellateError:
        raise
    except Exception as error:
        add_words(
            error,
            "solids.traced calls the function once, with symbols in place of numbers: it has to be "
            "made of numpy's functions alone",
        )
        raise
    if not isinstance(result, Symbols):
        raise InvalidArgument(f"the function does not depend on its argument: it is {result!r}")
    if result.cells.shape not in ((), (1,)):
        raise InvalidArgument(
            f"the function returns an array {_shape(result)}, and has to return (n,), one value for "
            "each point"
        )
    return _number(result.cells.reshape(-1)[0])


class Symbols(np.lib.mixins.NDArrayOperatorsMixin):
    """An array (n, ...) of formulas, n any number: `cells` has what there is for each row."""

    __array_priority__ = 1e6
    dtype = np.dtype(np.float64)

    def __init__(self, cells: Any) -> None:
        self.cells = cells if isinstance(cells, np.ndarray) else _array(cells)

    @property
    def shape(self) -> tuple[int, ...]:
        return (1, *self.cells.shape)

    @property
    def ndim(self) -> int:
        return 1 + self.cells.ndim

    @property
    def T(self) -> Any:  # noqa: N802
        return self if self.ndim == 1 else _Columns(self)

    def __len__(self) -> int:
        return 1

    def __getitem__(self, key: Any) -> Symbols:
        return Symbols(self.cells[self._within(key)])

    def __setitem__(self, key: Any, value: Any) -> None:
        inner = self._within(key)
        self.cells[inner] = _cells(value, 1 + np.ndim(self.cells[inner]))

    def _within(self, key: Any) -> tuple[Any, ...]:
        """An index of cells, from one of an array whose rows are all taken."""
        keys = key if isinstance(key, tuple) else (key,)
        if any(isinstance(k, Symbols) for k in keys):
            raise InvalidArgument(f"the function chooses rows by a mask: {_WHERE}")
        if keys and keys[0] is Ellipsis:
            taken = len([k for k in keys[1:] if k is not None])
            keys = (*[slice(None)] * (self.ndim - taken), *keys[1:])
        if not keys or not (isinstance(keys[0], slice) and keys[0] == slice(None)):
            raise InvalidArgument(
                "the function takes single rows out: x[:, 0] are all first coordinates, x[0] is a point"
            )
        return tuple(keys[1:])

    def __iter__(self) -> Any:
        raise InvalidArgument(
            "the function goes through its points one by one: compute with all rows at once; "
            "x[:, 0] are all first coordinates"
        )

    def __bool__(self) -> bool:
        raise InvalidArgument(
            f"the function branches on values (if, and, or, min(), max(), sorted()): {_WHERE}"
        )

    def __float__(self) -> float:
        raise InvalidArgument(
            "the function makes a plain number of what depends on the point: take numpy's functions, "
            "as numpy.sqrt for math.sqrt"
        )

    __int__ = __index__ = __complex__ = __float__

    def __array__(self, *unused: Any, **more: Any) -> Any:
        raise InvalidArgument(
            "the function makes an array of numbers of its argument, by numpy.array, asarray or a "
            "function that is not numpy's: leave that out, or compute with numpy alone. A list of them is "
            "one to numpy.max and numpy.maximum.reduce: take numpy.stack(...).max(axis=1), or "
            "functools.reduce(numpy.maximum, ...)"
        )

    def copy(self) -> Symbols:
        return Symbols(self.cells.copy())

    def astype(self, *unused: Any, **more: Any) -> Symbols:
        return self.copy()

    def reshape(self, *shape: Any) -> Symbols:
        sides = tuple(shape[0]) if len(shape) == 1 and isinstance(shape[0], tuple) else shape
        if len(sides) == 1 and self.cells.size == 1:
            return Symbols(self.cells.reshape(()))
        if not sides or sides[0] not in (-1, 1):
            raise InvalidArgument("the function reshapes rows: only what is in a row can be")
        return Symbols(self.cells.reshape(sides[1:]))

    def ravel(self) -> Symbols:
        return self.reshape(-1)

    def squeeze(self, axis: Any = None) -> Symbols:
        return Symbols(
            self.cells.squeeze() if axis is None else self.cells.squeeze(_axis(self, axis))
        )

    def sum(self, axis: Any = None, **more: Any) -> Symbols:
        return _reduced("add", self, axis, **more)

    def prod(self, axis: Any = None, **more: Any) -> Symbols:
        return _reduced("multiply", self, axis, **more)

    def max(self, axis: Any = None, **more: Any) -> Symbols:
        return _reduced("maximum", self, axis, **more)

    def min(self, axis: Any = None, **more: Any) -> Symbols:
        return _reduced("minimum", self, axis, **more)

    def mean(self, axis: Any = None, **more: Any) -> Symbols:
        total = _reduced("add", self, axis, **more)
        return _call("divide", (total, float(self.cells.shape[_axis(self, axis)])))

    def clip(self, least: Any = None, most: Any = None) -> Symbols:
        some = self if least is None else _call("maximum", (self, least))
        return some if most is None else _call("minimum", (some, most))

    def dot(self, other: Any) -> Symbols:
        return _times(self, other)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **more: Any) -> Any:
        name, out = ufunc.__name__, more.pop("out", None)
        if method == "reduce":
            return _reduced(name, inputs[0], more.pop("axis", 0), **more)
        if method != "__call__" or more:
            raise InvalidArgument(f"numpy.{name}.{method} with {sorted(more)} is not traced")
        result = _times(*inputs) if name == "matmul" else _call(name, inputs)
        if out is None:
            return result
        (into,) = out
        if not isinstance(into, Symbols):
            raise InvalidArgument(
                f"numpy.{name} writes into an array of numbers: use what it returns"
            )
        into.cells[...] = result.cells
        return into

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        traced = _FUNCTIONS.get(func.__name__)
        if traced is None or not (func.__module__ or "").startswith("numpy"):
            raise _untraced(func.__name__)
        try:
            return traced(*args, **kwargs)
        except TypeError as error:
            raise InvalidArgument(
                f"numpy.{func.__name__} is not traced with these arguments: {error}"
            ) from None


class _Columns:
    """A transposed array: its rows are the columns."""

    def __init__(self, of: Symbols) -> None:
        self._of = of

    def __getitem__(self, i: Any) -> Symbols:
        return self._of[:, i]

    def __iter__(self) -> Any:
        return (self._of[:, i] for i in range(self._of.cells.shape[0]))

    def __len__(self) -> int:
        return int(self._of.cells.shape[0])

    @property
    def T(self) -> Symbols:  # noqa: N802
        return self._of


def _untraced(name: str) -> InvalidArgument:
    if name in _FOLDS:
        return InvalidArgument(
            f"numpy.{name} folds space, or has steps, without end, which takes walls without end: for "
            "what repeats there is a periodic cell, oracles.PeriodicCell; a few copies are written out "
            "as a union"
        )
    return InvalidArgument(
        f"numpy.{name} is not traced: write it with sums, products, numpy.minimum, maximum, abs, clip, "
        "where, linalg.norm, stack and numpy's smooth functions, or give the solid's walls: "
        "solids.Implicit"
    )


def _array(cells: Any) -> Any:
    """Of Nodes, or of nested lists of them, of which numpy might make something else."""
    return np.array(cells, dtype=object)


def _shape(x: Symbols) -> str:
    return "(" + ", ".join(["n", *map(str, x.cells.shape)]) + ")"


def _cells(x: Any, ndim: int) -> Any:
    """What there is for each row, of symbols or of numbers, beside an array of so many axes."""
    if isinstance(x, Symbols):
        return x.cells
    values = np.asarray(x, dtype=np.float64)
    if values.ndim >= ndim:
        if values.shape[0] != 1:
            raise InvalidArgument(
                f"the function computes with an array of {values.shape}, as if there were that many "
                "points: it has to take any number of them"
            )
        values = values[0]
    return np.frompyfunc(constant, 1, 1)(values)


def _call(name: str, inputs: tuple[Any, ...]) -> Symbols:
    """A function of numpy's, element by element."""
    symbols = [x for x in inputs if isinstance(x, Symbols)]
    ndim = max(x.ndim for x in symbols)
    if len({x.ndim for x in symbols}) > 1 and min(x.ndim for x in symbols) == 1:
        shapes = " and ".join(_shape(x) for x in symbols)
        raise InvalidArgument(f"arrays {shapes} do not go together: say axis=1, keepdims=True")
    operation = _operation(name)
    made = np.frompyfunc(operation, len(inputs), 1)(*(_cells(x, ndim) for x in inputs))
    return Symbols(made)


def _operation(name: str) -> Callable[..., Any]:
    """Of a ufunc: Nodes, or conditions, to such."""
    if name in _COMPARED:
        above, below = _COMPARED[name]
        return lambda *a: _Condition(make("subtract", _number(a[above]), _number(a[below])))
    if name in ("logical_and", "bitwise_and"):
        return lambda a, b: _Condition(both=(_condition(a), _condition(b)))
    if name in ("logical_or", "bitwise_or"):
        return lambda a, b: ~_Condition(both=(~_condition(a), ~_condition(b)))
    if name in ("logical_not", "invert"):
        return lambda a: ~_condition(a)
    if name == "logaddexp":
        return lambda a, b: make(
            "log", make("add", make("exp", _number(a)), make("exp", _number(b)))
        )
    if name == "heaviside":
        return lambda a, b: make("where", _number(a), constant(1), constant(0))
    if name == "positive":
        return lambda a: a
    known = _SAME.get(name, name)
    if known not in SMOOTH and known not in ("maximum", "minimum", "absolute", "sign"):
        raise _untraced(name)
    return lambda *a: make(known, *map(_number, a))


class _Condition:
    """Whether a selector is above 0; or both of two conditions; or not."""

    def __init__(
        self,
        selector: Node | None = None,
        both: tuple[_Condition, _Condition] | None = None,
        negated: bool = False,
    ) -> None:
        self._selector, self._both, self._negated = selector, both, negated

    def __invert__(self) -> _Condition:
        return _Condition(self._selector, self._both, not self._negated)

    def where(self, first: Node, other: Node) -> Node:
        if self._negated:
            first, other = other, first
        if self._both is None:
            assert self._selector is not None
            return make("where", self._selector, first, other)
        a, b = self._both
        return a.where(b.where(first, other), other)


def _number(cell: Any) -> Node:
    """A Node; of a condition 1 or 0."""
    return cell.where(constant(1), constant(0)) if isinstance(cell, _Condition) else cell


def _condition(cell: Any) -> _Condition:
    if isinstance(cell, _Condition):
        return cell
    if cell.op == "constant":
        return _Condition(constant(1 if cell.value else -1))
    raise InvalidArgument("the function takes numbers for conditions: compare them, as by x > 0")


def _axis(x: Symbols, axis: Any) -> int:
    """Of cells. Raises: InvalidArgument, for that of the rows."""
    if axis is None and x.ndim > 1 or isinstance(axis, tuple) or x.ndim == 1:
        raise InvalidArgument(
            "the function reduces over its points, as by a sum without axis: a point's value must "
            "depend on that point alone: say axis=1"
        )
    inner = int(axis) % x.ndim - 1
    if inner < 0:
        raise InvalidArgument(
            "the function reduces over its points (axis=0): a point's value must depend on that point "
            "alone: say axis=1"
        )
    return inner


def _reduced(name: str, x: Any, axis: Any, keepdims: bool = False, **more: Any) -> Symbols:
    if any(value is not None for value in more.values()):
        raise InvalidArgument(f"numpy.{name}.reduce is not traced with {sorted(more)}")
    inner = _axis(x, axis)
    parts = [Symbols(part) for part in np.moveaxis(x.cells, inner, 0)]
    total = parts[0]
    for part in parts[1:]:
        total = _call(name, (total, part))
    return Symbols(np.expand_dims(total.cells, inner)) if keepdims else total


def _times(a: Any, b: Any) -> Symbols:
    """The product of rows with a matrix or a vector of numbers."""
    if not isinstance(a, Symbols) or isinstance(b, Symbols) or a.ndim != 2:
        raise InvalidArgument(
            "products of matrices are traced for x @ A alone, A of numbers: write others as sums"
        )
    matrix = np.asarray(b, dtype=np.float64)
    if matrix.ndim == 1:
        return (a * matrix).sum(axis=1)
    return Symbols([(a * column).sum(axis=1).cells[()] for column in matrix.T])


def _norm(x: Any, ord: Any = None, axis: Any = None, keepdims: bool = False) -> Symbols:
    if ord in (None, 2):
        return _call("sqrt", (_reduced("add", x * x, axis, keepdims),))
    if ord == 1:
        return _reduced("add", abs(x), axis, keepdims)
    if ord == np.inf:
        return _reduced("maximum", abs(x), axis, keepdims)
    raise InvalidArgument(f"numpy.linalg.norm is not traced with ord={ord!r}")


def _where(condition: Any, first: Any = None, other: Any = None) -> Symbols:
    if first is None or other is None:
        raise InvalidArgument("numpy.where is traced with three arguments")
    given = [x for x in (condition, first, other) if isinstance(x, Symbols)]
    ndim = max(x.ndim for x in given)
    cells = [_cells(x, ndim) for x in (condition, first, other)]
    choose = np.frompyfunc(lambda c, a, b: _condition(c).where(_number(a), _number(b)), 3, 1)
    return Symbols(choose(*cells))


def _clip(x: Any, a_min: Any = None, a_max: Any = None, *, min: Any = None, max: Any = None) -> Any:
    least, most = a_min if min is None else min, a_max if max is None else max
    some = x if least is None else _call("maximum", (x, least))
    return some if most is None else _call("minimum", (some, most))


def _stack(arrays: Any, axis: int = 0) -> Symbols:
    parts = list(arrays)
    ndim = max(x.ndim for x in parts if isinstance(x, Symbols))
    inner = axis % (ndim + 1) - 1
    if inner < 0:
        raise InvalidArgument("the function stacks in front of its points: say axis=1, or -1")
    cells = [_cells(x, ndim) for x in parts]
    shape = np.broadcast_shapes(*(np.shape(c) for c in cells))
    return Symbols(np.stack([np.broadcast_to(c, shape) for c in cells], axis=inner))


def _concatenate(arrays: Any, axis: int = 0) -> Symbols:
    parts = list(arrays)
    ndim = max(x.ndim for x in parts if isinstance(x, Symbols))
    inner = axis % ndim - 1
    if inner < 0:
        raise InvalidArgument("the function adds rows to its points: say axis=1, or -1")
    return Symbols(np.concatenate([_cells(x, ndim) for x in parts], axis=inner))


def _column_stack(arrays: Any) -> Symbols:
    parts = [x[:, None] if isinstance(x, Symbols) and x.ndim == 1 else x for x in arrays]
    return _concatenate(parts, axis=1)


def _full_like(x: Any, value: Any = 0.0, **unused: Any) -> Symbols:
    filled = np.empty(x.cells.shape, dtype=object)
    filled[...] = constant(value)
    return Symbols(filled)


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{
        name: (lambda x, axis=None, *, keepdims=False, op=op: _reduced(op, x, axis, keepdims))
        for name, op in _REDUCED.items()
    },
    "mean": lambda x, axis=None, **more: x.mean(axis, **more),
    "norm": _norm,
    "clip": _clip,
    "where": _where,
    "stack": _stack,
    "concatenate": _concatenate,
    "hstack": lambda arrays: _column_stack(arrays),
    "column_stack": _column_stack,
    "dot": _times,
    "zeros_like": lambda x, **more: _full_like(x, 0.0),
    "empty_like": lambda x, **more: _full_like(x, 0.0),
    "ones_like": lambda x, **more: _full_like(x, 1.0),
    "full_like": _full_like,
    "copy": lambda x, **more: x.copy(),
    "squeeze": lambda x, axis=None: x.squeeze(axis),
    "ravel": lambda x, **more: x.ravel(),
    "reshape": lambda x, *shape, **more: x.reshape(*shape),
    "transpose": lambda x: x.T,
    "atleast_2d": lambda x: x,
    "expand_dims": lambda x, axis: Symbols(np.expand_dims(x.cells, axis % (x.ndim + 1) - 1)),
}
