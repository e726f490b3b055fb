"""What the campaigns' command lines have in common: which runs, of which seed, and how they end."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from typing import TypeVar

import stellate

Case = TypeVar("Case")
Run = TypeVar("Run")


def parser(doc: str | None, runs: int | None, of_runs: str) -> argparse.ArgumentParser:
    """With --runs, --seed and --case; `doc`: the campaign's, `of_runs`: what --runs counts."""
    made = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    made.add_argument("--runs", type=int, default=runs, help=of_runs)
    made.add_argument("--seed", type=int, default=1, help="of all that is random (1)")
    made.add_argument("--case", type=int, help="the one run of this number")
    return made


def run_all(
    cases: Iterable[Case],
    one: Callable[[Case, stellate.Server], Run],
    show: Callable[[Case, Run], None],
) -> list[Run]:
    """The runs on a server of their own, each shown when it is over; ^C leaves those there are."""
    runs: list[Run] = []
    try:
        with stellate.Server() as server:
            for case in cases:
                runs.append(one(case, server))
                show(case, runs[-1])
    except KeyboardInterrupt:
        print("interrupted: what there is")
    return runs
