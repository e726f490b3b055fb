"""The gallery's page, from its programs and the facts about their meshes."""

from __future__ import annotations

import ast
import pathlib
import re

HERE = pathlib.Path(__file__).resolve().parent
FOLDER = HERE.parent / "docs" / "gallery"
_TOOLS = ("page", "run_one")
_SIMPLICES = {1: "segments", 2: "triangles", 3: "tetrahedra", 4: "pentatopes"}
_HEAD = """# Gallery

{count} manifolds, each a program of some twenty lines and the picture that it makes. `gallery/build` runs
them all, and writes this page; each also runs on its own: `python3 gallery/knot.py` leaves `knot.png`.
Pictures are by [`mesh.plot()`](../using/pictures.md).

## By field
"""
_FIELDS = {
    "Parts and solids": ("drilled_block", "drilled_and_joined", "wedge", "l_domain"),
    "Materials and lattices": ("composite", "gyroid", "gyroid_box", "schwarz"),
    "Robots and mechanisms": ("linkage", "linkage_limits", "joint_limits", "product"),
    "Molecules and crystals": ("cycloheptane", "copper"),
    "Scans, learning, statistics": ("cloud", "remeshed", "neural", "shapes"),
    "Dynamical systems": ("invariant_torus", "three_torus"),
    "Rotations and other groups": (
        "rotations", "orthogonal", "level_set", "solid_torus", "grassmannian",
    ),
    "Surfaces": (
        "genus_two", "hemisphere", "klein_bottle", "knot", "moebius_strip", "projective_plane",
    ),
}  # fmt: skip
_ACROSS = 4  # thumbnails


def programs() -> list[str]:
    """The names of the gallery's programs."""
    return sorted(file.stem for file in HERE.glob("*.py") if file.stem not in _TOOLS)


def text(facts: dict[str, dict]) -> str:
    """The page in Markdown."""
    names = programs()
    shown = sorted(name for field in _FIELDS.values() for name in field)
    if shown != names:
        raise ValueError(f"each program is to be in one field: {sorted(set(shown) ^ set(names))}")
    return "\n".join(
        [
            _HEAD.format(count=len(names)),
            *(_thumbnails(field, of) for field, of in _FIELDS.items()),
            *(_entry(name, facts[name]) for name in names),
        ]
    )


def _thumbnails(field: str, names: tuple[str, ...]) -> str:
    """A table of pictures, each with its title, which leads to its entry."""
    cells = [f"[![]({name}.png) {_title(name)}](#{_anchor(_title(name))})" for name in names]
    rows = [cells[i : i + _ACROSS] for i in range(0, len(cells), _ACROSS)]
    width = _ACROSS
    lines = [f"| {row} |" for row in (" | ".join(r + [""] * (width - len(r))) for r in rows)]
    head = f"| {field} |" + " |" * (width - 1)
    return "\n".join([head, "|" + "---|" * width, *lines, ""])


def _title(name: str) -> str:
    docstring = ast.get_docstring(ast.parse((HERE / f"{name}.py").read_text())) or ""
    return docstring.partition("\n")[0]


def _anchor(title: str) -> str:
    """Of a heading, as forges make it."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def _entry(name: str, fact: dict) -> str:
    source = (HERE / f"{name}.py").read_text()
    module = ast.parse(source)
    docstring = ast.get_docstring(module) or ""
    title, _, words = docstring.partition("\n\n")
    first = module.body[1].lineno  # after the docstring, which the page says already
    return f"""## {title}

![{title}]({name}.png)

{words}

{_sentence(fact)}

```{{literalinclude}} ../../gallery/{name}.py
:language: python
:lines: {first}-
```

The program: [gallery/{name}.py](../../gallery/{name}.py)
"""


def _sentence(fact: dict) -> str:
    k, d = fact["dimension"], fact["ambient_dimension"]
    kind = _SIMPLICES.get(k, f"{k}-simplices")
    counts = f"{fact['vertices']:,} vertices, {fact['simplices']:,} {kind}"
    pieces = "1 component" if fact["components"] == 1 else f"{fact['components']} components"
    turn = "orientable" if fact["orientable"] else "not orientable"
    verdict = "**Certified**" if fact["certified"] else "**Not certified**"
    return (
        f"Dimension {k} in R^{d}; epsilon {fact['epsilon']:g}: {counts}. {verdict}: {pieces}, "
        f"Euler characteristic {fact['euler_characteristic']}, {turn}{_boundary(fact)}."
    )


def _boundary(fact: dict) -> str:
    words = ("wall", "edge", "corner")
    counts = [(n, word) for n, word in zip(fact.get("faces", []), words) if n]
    if not counts:
        return ""
    return ", with a boundary of " + ", ".join(
        f"{n} {word}{'s' if n > 1 else ''}" for n, word in counts
    )
