"""Formulas as graphs, which know their derivatives and the places where they branch."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, Callable

import numpy as np

from .._rows import Array

# Smooth functions of one argument, and their derivatives from the argument and the value.
_Slope = Callable[["Node", "Node"], "Node"]
_ONE: dict[str, _Slope] = {
    "sqrt": lambda a, y: make("half_inverse", y),
    "exp": lambda a, y: y,
    "exp2": lambda a, y: make("multiply", y, constant(np.log(2))),
    "expm1": lambda a, y: make("add", y, constant(1)),
    "log": lambda a, y: make("reciprocal", a),
    "log2": lambda a, y: make("divide", constant(1 / np.log(2)), a),
    "log10": lambda a, y: make("divide", constant(1 / np.log(10)), a),
    "log1p": lambda a, y: make("reciprocal", make("add", a, constant(1))),
    "sin": lambda a, y: make("cos", a),
    "cos": lambda a, y: make("negative", make("sin", a)),
    "tan": lambda a, y: make("add", constant(1), make("square", y)),
    "arcsin": lambda a, y: make("reciprocal", make("sqrt", _one_less(make("square", a)))),
    "arccos": lambda a, y: make(
        "negative", make("reciprocal", make("sqrt", _one_less(make("square", a))))
    ),
    "arctan": lambda a, y: make("reciprocal", make("add", constant(1), make("square", a))),
    "sinh": lambda a, y: make("cosh", a),
    "cosh": lambda a, y: make("sinh", a),
    "tanh": lambda a, y: _one_less(make("square", y)),
    "square": lambda a, y: make("multiply", constant(2), a),
    "reciprocal": lambda a, y: make("negative", make("square", y)),
    "cbrt": lambda a, y: make("divide", constant(1 / 3), make("square", y)),
    "negative": lambda a, y: constant(-1),
}
_TWO = ("add", "subtract", "multiply", "divide", "power", "hypot", "arctan2")
SMOOTH = (*_ONE, *_TWO)
# Choices by the sign of a selector: see Node.selector.
BRANCHES = ("maximum", "minimum", "absolute", "where", "sign")


@dataclasses.dataclass(frozen=True, eq=False)
class Node:
    """A formula: an operation, numpy's but for "x", "constant", "where" and "half_inverse".

    A where has three arguments, of which the first is no condition but its selector: it is the second
    where that is above 0, and the third elsewhere. Nodes that are the same are one object.
    """

    op: str
    args: tuple[Node, ...] = ()
    value: float = 0.0  # of a constant; the number of a coordinate

    def selector(self) -> Node:
        """Of a branch: what is above 0 where it is its first choice, and below where its other."""
        if self.op in ("absolute", "sign", "where"):
            return self.args[0]
        difference = make("subtract", *self.args)
        return difference if self.op == "maximum" else make("negative", difference)

    def choice(self, first: bool) -> Node:
        """What a branch is on one side of its selector."""
        if self.op == "absolute":
            return self.args[0] if first else make("negative", self.args[0])
        if self.op == "sign":
            return constant(1 if first else -1)
        return self.args[-2] if first else self.args[-1]


_known: dict[Any, Node] = {}


def make(op: str, *args: Node) -> Node:
    """The node of an operation, with what is known of 0, 1 and constants made use of."""
    if args and all(a.op == "constant" for a in args):
        with np.errstate(all="ignore"):
            return constant(_FUNCTIONS[op](*(np.float64(a.value) for a in args)))
    values = [a.value if a.op == "constant" else None for a in args]
    if op == "add" and 0 in values:
        return args[1] if values[0] == 0 else args[0]
    if op == "subtract" and values[1] == 0:
        return args[0]
    if op == "subtract" and args[0] is args[1]:
        return constant(0)
    if op == "multiply":
        if 0 in values:
            return constant(0)
        if 1 in values:
            return args[1] if values[0] == 1 else args[0]
        if args[0] is args[1]:
            return make("square", args[0])
        for one, other in (args, args[::-1]):  # 4 * y * y
            if one.op == "multiply" and other in one.args:
                times = one.args[0] if one.args[1] is other else one.args[1]
                if times.op == "constant":
                    return make("multiply", times, make("square", other))
    if op == "divide" and (values[0] == 0 or values[1] == 1):
        return args[0]
    if op == "power" and values[1] in (0.5, 1, 2):
        return args[0] if values[1] == 1 else make("square" if values[1] == 2 else "sqrt", args[0])
    # Norms of one component, which others are frozen to: they keep their sign, as norms do not.
    if op == "sqrt" and args[0].op == "square":
        return make("absolute", *args[0].args)
    if op == "sqrt" and args[0].op == "multiply":
        for one, other in (args[0].args, args[0].args[::-1]):
            if one.op == "square" and other.op == "constant" and other.value > 0:
                return make("multiply", make("absolute", *one.args), make("sqrt", other))
    if op == "hypot" and 0 in values:
        return make("absolute", args[1] if values[0] == 0 else args[0])
    if op == "negative" and args[0].op == "negative":
        return args[0].args[0]
    if op in ("maximum", "minimum") and args[0] is args[1]:
        return args[0]
    if op == "where" and args[1] is args[2]:
        return args[1]
    return _kept(Node(op, args))


def constant(value: Any) -> Node:
    return _kept(Node("constant", (), float(value)))


def coordinate(number: int) -> Node:
    return _kept(Node("x", (), float(number)))


def _kept(node: Node) -> Node:
    key = node.op, tuple(map(id, node.args)), node.value, np.signbit(node.value)
    return _known.setdefault(key, node)


def forget() -> None:
    """Lets go of all nodes: those that are made from now on are other ones."""
    _known.clear()


def _one_less(node: Node) -> Node:
    """1 - node"""
    return make("subtract", constant(1), node)


def in_order(roots: Sequence[Node]) -> list[Node]:
    """All nodes below the roots, arguments first."""
    order: dict[int, Node] = {}
    stack = [(root, False) for root in reversed(roots)]
    while stack:
        node, done = stack.pop()
        if id(node) in order:
            continue
        if done:
            order[id(node)] = node
        else:
            stack.append((node, True))
            stack += [(a, False) for a in reversed(node.args) if id(a) not in order]
    return list(order.values())


def frozen(root: Node, choices: dict[int, bool]) -> Node:
    """The formula with branches, by id, replaced by one of their choices."""
    new: dict[int, Node] = {}
    for node in in_order([root]):
        args = tuple(new[id(a)] for a in node.args)
        if node.op in ("x", "constant"):
            new[id(node)] = node
        elif id(node) in choices:
            new[id(node)] = Node(node.op, args).choice(choices[id(node)])
        else:
            new[id(node)] = make(node.op, *args)
    return new[id(root)]


def gradient(root: Node, d: int) -> list[Node]:
    """Its derivatives by the d coordinates."""
    order = in_order([root])
    zero = constant(0)
    above = {id(node): zero for node in order}
    above[id(root)] = constant(1)
    slopes = [zero] * d
    for node in reversed(order):
        given = above[id(node)]
        if node.op == "x":
            slopes[int(node.value)] = given
        if given is zero:
            continue
        for arg, slope in zip(node.args, _slopes(node)):
            if slope is not None:
                above[id(arg)] = make("add", above[id(arg)], make("multiply", given, slope))
    return slopes


def _slopes(node: Node) -> list[Node | None]:
    """Derivatives by the arguments; None: none goes there."""
    args = node.args
    if node.op in _ONE:
        return [_ONE[node.op](args[0], node)]
    one, zero = constant(1), constant(0)
    if node.op == "add":
        return [one, one]
    if node.op == "subtract":
        return [one, constant(-1)]
    if node.op == "multiply":
        return [args[1], args[0]]
    if node.op == "divide":
        return [make("reciprocal", args[1]), make("negative", make("divide", node, args[1]))]
    if node.op == "power":
        down = make("power", args[0], make("subtract", args[1], one))
        by_exponent = None
        if args[1].op != "constant":
            by_exponent = make("multiply", node, make("log", args[0]))
        return [make("multiply", args[1], down), by_exponent]
    if node.op == "hypot":
        over = make("multiply", constant(2), make("half_inverse", node))
        return [make("multiply", a, over) for a in args]
    if node.op == "arctan2":
        squares = make("add", make("square", args[0]), make("square", args[1]))
        return [
            make("divide", args[1], squares),
            make("negative", make("divide", args[0], squares)),
        ]
    if node.op == "absolute":
        return [make("sign", args[0])]
    if node.op in ("maximum", "minimum"):
        which = node.selector()
        return [make("either", which, one, zero), make("either", which, zero, one)]
    if node.op == "where":
        return [None, make("where", args[0], one, zero), make("where", args[0], zero, one)]
    return [None] * len(args)  # of constants, and of signs


class Program:
    """Formulas to be evaluated: (n, d) -> (n, m). Equal if they are the same, and can be pickled."""

    def __init__(self, roots: Sequence[Node]) -> None:
        order = in_order(roots)
        place = {id(node): i for i, node in enumerate(order)}
        self._steps = tuple(
            (node.op, tuple(place[id(a)] for a in node.args), node.value) for node in order
        )
        self._results = tuple(place[id(root)] for root in roots)

    def __call__(self, points: Array) -> Array:
        count = len(points)
        done: list[Any] = []
        with np.errstate(all="ignore"):
            for op, args, value in self._steps:
                if op == "x":
                    done.append(np.ascontiguousarray(points[:, int(value)]))
                elif op == "constant":
                    done.append(np.float64(value))
                else:
                    done.append(_FUNCTIONS[op](*(done[i] for i in args)))
        values = np.empty((count, len(self._results)))
        for column, i in enumerate(self._results):
            values[:, column] = done[i]
        return values

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Program):
            return NotImplemented
        return (self._steps, self._results) == (other._steps, other._results)

    def __hash__(self) -> int:
        return hash((self._steps, self._results))


def _half_inverse(y: Any) -> Any:
    """1 / (2 y), and 0 at 0: what is multiplied by it is 0 there as well."""
    return np.where(y == 0, 0.0, 0.5 / np.where(y == 0, 1.0, y))


def _where(selector: Any, first: Any, other: Any) -> Any:
    return np.where(selector > 0, first, other)


def _either(selector: Any, first: Any, other: Any) -> Any:
    """Half of each where the selector is 0, and a derivative neither: max(t, 0) is not flat there."""
    return np.where(selector == 0, 0.5 * (first + other), _where(selector, first, other))


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{name: getattr(np, name) for name in (*SMOOTH, "maximum", "minimum", "absolute", "sign")},
    "half_inverse": _half_inverse,
    "where": _where,
    "either": _either,
}
