"""What is compared: manifolds, peers and sizes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Mesher:
    """A program of the `peers` binary, with what it is asked for."""

    name: str  # for people
    program: str  # of the binary
    manifold: str  # of the catalogue
    start_size: float | None  # coarse, to extrapolate from; None: the size is the number wanted
    exponent: float  # the number of vertices goes with this power of the size
    options: tuple[str, ...] = ()


@dataclass(frozen=True)
class Case:
    """One manifold, one peer and Stellate."""

    title: str
    peer: Mesher
    ours: Mesher
    # No coarser than this: 0.4 of the reach, where certificates begin to be refused.
    coarsest: float
    quick: tuple[int, ...] = ()  # numbers of vertices
    full: tuple[int, ...] = ()  # further ones with --full

    def name(self, count: int) -> str:
        """What --only is matched against."""
        return f"{self.title}, {self.peer.name}, {count}"


def _cgal(title: str, manifold: str, start: float, coarsest: float) -> Case:
    return Case(
        title=title,
        peer=Mesher("CGAL surface mesher", "cgal-surface", manifold, start, -2),
        # The same bound on angles: 30 degrees is a radius-edge ratio of 1.
        ours=Mesher("Stellate", "stellate", manifold, start, -2, ("--radius-edge", "1.0001")),
        coarsest=coarsest,
        quick=(10_000,),
        full=(100_000,),
    )


def _tangential(
    title: str,
    manifold: str,
    dimension: int,
    start: float,
    coarsest: float,
    given: tuple[tuple[int, ...], tuple[int, ...]],
    estimated: tuple[tuple[int, ...], tuple[int, ...]],
) -> list[Case]:
    """The tangential complex with the tangent spaces given to it, and with its own estimate."""
    ours = Mesher("Stellate", "stellate", manifold, start, -dimension)
    cases = []
    for name, options, (quick, full) in (
        ("GUDHI tangential complex, tangents given", (), given),
        ("GUDHI tangential complex", ("--estimate-tangents",), estimated),
    ):
        options = ("--time-limit", "600", *options)
        peer = Mesher(name, "gudhi-tangential", manifold, None, 1, options)
        cases.append(Case(title, peer, ours, coarsest, quick, full))
    return cases


def _coxeter(
    title: str,
    dimension: int,
    manifolds: tuple[str, str],
    options: tuple[str, ...],
    starts: tuple[float, float],
    full: tuple[int, ...],
    both: tuple[str, ...] = (),
) -> Case:
    options = (*options, *both)
    peer = Mesher(
        "GUDHI Coxeter tracing", "gudhi-coxeter", manifolds[0], starts[0], -dimension, options
    )
    ours = Mesher("Stellate", "stellate", manifolds[1], starts[1], -dimension, both)
    return Case(title, peer, ours, 0.4, (10_000,), full)


CASES: tuple[Case, ...] = (
    _cgal("S² in R³", "sphere:2", 0.1, 0.4),
    _cgal("torus in R³", "torus:1:0.4", 0.1, 0.16),
    _cgal("tanglecube in R³", "tanglecube", 0.2, 0.2),
    *_tangential(
        "T² in R⁴", "clifford-torus", 2, 0.1, 0.28, ((10_000,), (100_000,)), ((10_000,), ())
    ),
    *_tangential("S³ in R⁴", "sphere:3", 3, 0.3, 0.4, ((5_000,), (30_000,)), ((5_000,), ())),
    *_tangential("SO(3) in R⁹", "so3", 3, 0.5, 0.56, ((8_000,), ()), ((), (8_000,))),
    _coxeter("S² in R⁸", 2, ("sphere:2", "sphere:2:8"), ("--ambient", "8"), (0.5, 0.1), (100_000,)),
    _coxeter(
        "S² in R⁸, cut",
        2,
        ("sphere:2", "sphere:2:8"),
        ("--ambient", "8"),
        (0.4, 0.08),
        (100_000,),
        ("--clip", "0.2"),
    ),
    _coxeter("S³ in R⁴", 3, ("sphere:3", "sphere:3"), (), (0.4, 0.3), (50_000,)),
    _coxeter("T³ in R⁶", 3, ("flat-torus:3", "flat-torus:3"), (), (1.2, 0.4), (50_000,)),
)
