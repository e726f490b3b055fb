"""The gallery's page, from its programs and the facts about their meshes."""

from __future__ import annotations

import ast
import pathlib

HERE = pathlib.Path(__file__).resolve().parent
FOLDER = HERE.parent / "docs" / "gallery"
_TOOLS = ("page", "run_one")
_SIMPLICES = {1: "segments", 2: "triangles", 3: "tetrahedra", 4: "pentatopes"}
_HEAD = """# Gallery

{count} manifolds, each a program of some twenty lines and the picture that it makes. `gallery/build` runs
them all, and writes this page; each also runs on its own: `python3 gallery/knot.py` leaves `knot.png`.
Pictures are by [`mesh.plot()`](../using/pictures.md).
"""


def programs() -> list[str]:
    """The names of the gallery's programs."""
    return sorted(file.stem for file in HERE.glob("*.py") if file.stem not in _TOOLS)


def text(facts: dict[str, dict]) -> str:
    """The page in Markdown."""
    names = programs()
    return "\n".join(
        [_HEAD.format(count=len(names)), *(_entry(name, facts[name]) for name in names)]
    )


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
