"""epsilon="auto": a size from what the oracle's answers show."""

from __future__ import annotations

import numbers
from typing import Any, Callable, Literal, Union

import numpy as np

from ._findings import CheckReport
from ._shared import table
from .errors import InvalidArgument, OracleError

Auto = Literal["auto"]
Epsilon = Union[float, Auto]  # a length, or to be chosen
AUTO: Auto = "auto"


def what_epsilon_is(auto: str = 'epsilon="auto"') -> str:
    """For those who gave none; `auto`: how they write it."""
    what: str = table("auto.toml")["epsilon_is"]
    return what.replace("{auto}", auto)


def what_is_missing() -> str:
    """What is said in Python to those who gave none."""
    return f"epsilon is missing: {what_epsilon_is()}"


def choose(
    oracle: Any,
    epsilon: Epsilon | None,
    check: Callable[[Any], CheckReport],
    tell: Callable[[str], None] = lambda text: None,
) -> tuple[float, str]:
    """epsilon as it is and "", or for "auto" what the server says after check(oracle), and why.

    `tell` is called before the oracle is asked, which may take a slow one long.

    Raises: OracleError with what check() found where the oracle breaks its contract; TypeError for None.
    """
    if epsilon is None:
        raise TypeError(what_is_missing())
    if isinstance(epsilon, numbers.Real) and not isinstance(epsilon, (bool, np.bool_)):
        return float(epsilon), ""  # the server says which lengths will do
    if not isinstance(epsilon, str) or epsilon != AUTO:
        raise InvalidArgument(
            f"epsilon has to be a length in the coordinates' unit, or 'auto', and is {epsilon!r}",
            details={"fields": {"epsilon": "no length"}},
        )
    tell("epsilon='auto': the oracle is asked for its reach first")
    report = check(oracle)
    if report.epsilon is not None:
        return report.epsilon, report.epsilon_reason
    raise OracleError(
        f"epsilon='auto' cannot be chosen: {report.epsilon_reason}",
        "ORACLE_NO_REACH" if report.ok else "ORACLE_BREAKS_CONTRACT",
    )
