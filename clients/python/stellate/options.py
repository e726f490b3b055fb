"""What a mesh can be asked for beside epsilon: the one place that says which options there are.

    settings: stellate.MeshOptions = {"max_vertices": 100_000, "audit": "thorough"}
    mesh = stellate.mesh(oracle, 0.1, **settings)

From these two classes come what type checkers, help() and completion know of stellate.mesh and its
like, the error for a misspelt option, and the flags of `python3 -m stellate`.
"""

# Without annotations from __future__: what the types are is asked for here, in Python 3.9 as well.
import inspect
import re
import textwrap
from collections.abc import Sequence
from functools import partial
from typing import (
    Annotated,
    Any,
    Callable,
    Literal,
    Optional,
    TypedDict,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np

__all__ = ["MeshOptions", "SpecOptions"]

Audit = Literal["standard", "thorough"]
Shape = Literal["good"]
F = TypeVar("F", bound=Callable[..., Any])


class SpecOptions(TypedDict, total=False):
    """Options that belong to a mesh's specification. None is the same as not given."""

    radius_edge_bound: Annotated[
        Optional[float], "largest circumradius / shortest edge, rule R2 (rho0); default 2"
    ]
    sliver_bound: Annotated[
        Optional[float],
        "least fatness of a simplex, rule R3 (Theta0), 0: off; default 0 for k <= 2, and 0.25, "
        "0.15, 0.1 for k = 3, 4, 5, 0.2 for k = 3 with a boundary",
    ]
    shape: Annotated[
        Optional[Shape],
        "'good', for closed manifolds of k = 3: sliver_bound 0.3, and dihedral angles of 18 degrees at least in place "
        "of 14, with 5 to 25 % more vertices",
    ]
    picking_radius: Annotated[
        Optional[float], "size of the picking region in circumradii (delta); default 0.4"
    ]
    small_sliver_radius: Annotated[
        Optional[float],
        "new slivers larger than this do not count against a candidate (beta); default 2",
    ]
    candidates: Annotated[
        Optional[int],
        "points tried in a picking region; default 1 for k <= 2, else 10, or 40 where sliver_bound "
        "is above 0.25",
    ]
    advance_step: Annotated[
        Optional[float],
        "how far the front steps over unknown ground, a length (h); default 3 epsilon, or a tenth "
        "of the box's diagonal where that is more",
    ]
    flat_alternations: Annotated[
        Optional[int],
        "closest points spent on reaching a flat, where there is no intersect_flat; default 1",
    ]
    speculative: Annotated[
        Optional[bool],
        "refine a surrogate of M first: fewer round trips, more processor time; default: on "
        "where the server is on another machine",
    ]
    common_centre: Annotated[
        Optional[bool],
        "judge a simplex at one centre for all its vertices; default: for k >= 3, where sizes are "
        "not graded",
    ]
    size_rate: Annotated[
        Optional[float],
        "circumradii are at most this share of the local size: the oracle's local_size, or one "
        "that is estimated; default: one size everywhere",
    ]
    max_deviation: Annotated[
        Optional[float],
        "circumcentres are at most so far from the manifold, a length; default: no such bound",
    ]
    protection: Annotated[
        Optional[float],
        "keep other vertices off the ball of each simplex by this share of epsilon, rule R5; at most 0.1 "
        "for k <= 2, 0.05 for k = 3; default 0: off",
    ]
    max_vertices: Annotated[Optional[int], "stop there; default: the server's limit"]
    max_rounds: Annotated[
        Optional[int], "stop after this many round trips; default: the server's limit"
    ]
    max_batch_queries: Annotated[
        Optional[int], "ask larger rounds in several batches; default: no limit"
    ]
    worker_wait_seconds: Annotated[
        Optional[float], "seconds that the mesh waits for a worker; default: the server's"
    ]
    answer_seconds: Annotated[
        Optional[float], "seconds that a worker may be silent over a chunk; default: the server's"
    ]
    busy_seconds: Annotated[
        Optional[float], "seconds that a worker may take for a chunk in all; default: the server's"
    ]
    random_seed: Annotated[Optional[int], "seed of everything random; default 1"]
    box_seeds: Annotated[
        Optional[int], "random points of the box that are tried as seeds; default 100"
    ]
    boundary_only: Annotated[
        Optional[bool],
        "mesh the boundary of a solid alone, and what is between regions, without the inside: "
        "simplices of one dimension less; default: off",
    ]
    seeds: Annotated[
        Union[np.ndarray, Sequence[Any], None],
        "(m, d) points near the manifold; default: the oracle's seeds",
    ]
    components: Annotated[
        Optional[int], "how many the manifold has at least: a mesh with fewer is not certified"
    ]
    reach: Annotated[
        Optional[float],
        "a lower bound of the manifold's reach, a length, from which the mesh is proved",
    ]
    cover_box: Annotated[
        Optional[bool], "miss no component in the bounding box, which needs reach; default: off"
    ]
    audit: Annotated[
        Optional[Audit],
        "how much is asked before certifying; 'thorough': about every vertex and every simplex; "
        "default 'standard'",
    ]
    label: Annotated[Optional[str], "that lists and logs show, of 128 bytes at most"]


class MeshOptions(SpecOptions, total=False):
    """All options of stellate.mesh and stellate.watch: SpecOptions, and how the oracle is called."""

    workers: Annotated[
        Optional[int],
        "threads that call the oracle, if it says thread_safe = True; the mesh is the same for any "
        "number; default 1",
    ]
    max_chunk: Annotated[
        Optional[int],
        "most points in one call of the oracle; default: as many as take it a quarter of a "
        "second, or four times what a call of it costs",
    ]


def types(options: type) -> dict[str, Any]:
    """The options by name, with their types."""
    return get_type_hints(options)


def meanings(options: type) -> dict[str, str]:
    """The options by name, with what each is."""
    hints = get_type_hints(options, include_extras=True)
    return {name: hint.__metadata__[0] for name, hint in hints.items()}


def plain_type(hint: Any) -> Any:
    """Of Optional[int] int, of Optional[Literal["a", "b"]] the latter: what an option is where given."""
    return next(part for part in get_args(hint) if part is not type(None))


def choices(hint: Any) -> tuple[str, ...]:
    """What may be chosen; () where it is no choice."""
    kind = plain_type(hint)
    return get_args(kind) if get_origin(kind) is Literal else ()


def takes(options: type) -> Callable[[F], F]:
    """Makes help(), completion and inspect.signature show the options behind a function's `**options`.

    Where its documentation says "{options}" they are listed, a paragraph each.
    """

    def shown(function: F) -> F:
        known, written = types(options), inspect.signature(function)
        named = [p for p in written.parameters.values() if p.kind is not p.VAR_KEYWORD]
        more = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=kind)
            for name, kind in known.items()
        ]
        about: Any = function
        about.__signature__ = written.replace(parameters=[*named, *more])
        of_named = {n: t for n, t in function.__annotations__.items() if n != "options"}
        about.__annotations__ = {**of_named, **known}
        if function.__doc__ is not None:  # python3 -OO leaves it out
            about.__doc__ = re.sub(r"( *)\{options\}", partial(_listed, options), function.__doc__)
        return function

    return shown


def _listed(options: type, place: re.Match[str]) -> str:
    margin = place[1]
    entries = (f"{name}: {meaning}." for name, meaning in meanings(options).items())
    return "\n".join(
        textwrap.fill(entry, 100, initial_indent=margin, subsequent_indent=margin + "  ")
        for entry in entries
    )
