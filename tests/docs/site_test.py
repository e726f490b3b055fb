"""Builds the site, in which any warning is an error, and looks whether all is there: every page, every
link and picture, and of the reference what it is generated from. Usage: site_test.py BIN OUTPUT"""

from __future__ import annotations

import pathlib
import re
import subprocess
import sys
import tempfile
import types
from html.parser import HTMLParser
from urllib.parse import unquote, urlsplit

import blocks

ROOT = pathlib.Path(__file__).resolve().parents[2]


class Page(HTMLParser):
    """What a page refers to, what of it can be referred to, what it loads."""

    def __init__(self, path: pathlib.Path) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.ids: set[str] = set()
        self.feed(path.read_text())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.ids.add(values.get("id") or "")
        wanted = {"a": "href", "img": "src", "script": "src", "link": "href"}.get(tag)
        if wanted and (value := values.get(wanted)):
            self.links.add(value)
            if tag != "a" and re.match(r"(https?:)?//", value):
                self.links.add(f"from-the-network:{value}")


def broken(html: pathlib.Path) -> list[str]:
    parsed = {path: Page(path) for path in html.rglob("*.html")}
    found = []
    for path, page in parsed.items():
        for link in page.links:
            name = path.relative_to(html)
            parts = urlsplit(link)
            if parts.scheme == "from-the-network":
                found.append(f"{name} loads {parts.path}")
            if parts.scheme or parts.netloc:
                continue
            there = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not there.exists():
                found.append(f"{name}: {link} leads nowhere")
            elif there in parsed and parts.fragment and parts.fragment not in parsed[there].ids:
                found.append(f"{name}: {link} names nothing there")
    return found


def unstyled(html: pathlib.Path) -> list[str]:
    """What styles want and is not in the site, and sections whose words were taken for names."""
    found = []
    for style in html.rglob("*.css"):
        for url in re.findall(r"url\(['\"]?([^'\")]+)", style.read_text()):
            there = style.parent / url.partition("?")[0].partition("#")[0]
            if not url.startswith(("data:", "#")) and (url.startswith("/") or not there.exists()):
                found.append(f"{style.relative_to(html)}: {url} is not in the site")
    for page in html.rglob("*.html"):
        if re.search(r"<dt[^>]*>\s*Raises", page.read_text()):
            found.append(
                f"{page.relative_to(html)}: 'Raises' is a list of names, and has to be words"
            )
    return found


def missing(html: pathlib.Path, programs: pathlib.Path) -> list[str]:
    """Of the pages, and of the reference."""
    found = []
    pages = {pathlib.Path(name) for name in blocks.pages()}
    pages |= {path.relative_to(ROOT) for path in ROOT.glob("clients/*/README.md")}
    for page in sorted(pages):
        if not (html / page.with_suffix(".html")).exists():
            found.append(f"the site has no {page}")

    def wants(page: str, names: set[str], source: str) -> None:
        text = (html / "reference" / f"{page}.html").read_text()
        assert names, source
        words = set(re.findall(r"[\w-]+", text))
        lost = sorted(name for name in names if name not in words)
        found.extend(f"the reference of {page} has no {name} ({source})" for name in lost)

    headers = [*(ROOT / "clients/cpp/include/stellate").rglob("*.h"), ROOT / "core/mesher.h"]
    classes = {
        t for h in headers for t in re.findall(r"(?m)^(?:class|struct) (\w+)[^;]*{", h.read_text())
    }
    wants("cpp", classes, "public headers")
    sys.path.insert(0, str(ROOT / "clients" / "python"))
    import stellate

    offering = [m for m in vars(stellate).values() if isinstance(m, types.ModuleType)]
    offered = {name for m in (stellate, *offering) for name in getattr(m, "__all__", ())}
    wants("python", offered, "__all__")
    text = (html / "reference" / "python.html").read_text()
    for name in stellate.MeshOptions.__annotations__:
        if f"<strong>{name}</strong>" not in text:
            found.append(f"the reference of stellate.mesh does not list {name}")
    proto = "".join(path.read_text() for path in (ROOT / "proto/stellate/v1").glob("*.proto"))
    wants("protocol", set(re.findall(r"(?m)^ *(?:message|enum|rpc) (\w+)", proto)), "proto")
    printed = subprocess.run(
        [programs / "stellated", "--print-config"], capture_output=True, text=True, check=True
    ).stdout
    wants("settings", set(re.findall(r"(?m)^#? ?([a-z-]+) = ", printed)), "--print-config")
    listed = (ROOT / "docs/running/metrics.md").read_text()
    gauges = set(re.findall(r"(?m)^\| `(stellate_\w+)`? *.*\| gauge", listed))
    wants("metrics", gauges, "docs/running/metrics.md")
    shown = subprocess.run([programs / "stellate", "--help"], capture_output=True, text=True).stdout
    commands = set(re.findall(r"(?m)^  (\w+) ", shown.partition("Subcommands:")[2]))
    wants("command-lines", commands, "stellate --help")
    return found


def can_fail() -> None:
    made_up = '<a href="no.html"><a href="#no"><script src="//example.org/x.js"></script><a id="b" href="#b">'
    with tempfile.TemporaryDirectory() as folder:
        (pathlib.Path(folder) / "page.html").write_text(made_up)
        assert len(broken(pathlib.Path(folder))) == 3


def plain(html: pathlib.Path) -> list[str]:
    """Formulas that are not typeset, and code without a button that copies it."""
    found = []
    for page, wanted in (
        ("docs/gallery/index.html", "Dimension 2 in <em>R</em><sup>3</sup>"),
        ("docs/howto/equations.html", "<em>R</em><sup>d\u2212k</sup>"),
        ("README.html", "O(<em>\u03b5</em><sup>\u2212k</sup>)"),
        ("index.html", 'url=README.html"'),  # where one arrives: the strip, and a mesh that grows
        ("README.html", "growing.gif"),
    ):
        if wanted not in (html / page).read_text():
            found.append(f"{page} does not have {wanted}")
    for page in html.rglob("*.html"):
        text = page.read_text()
        if '<div class="highlight"' in text and "_static/copy.js" not in text:
            found.append(f"{page.relative_to(html)} has code that no button copies")
    shown = (html / "docs/gallery/index.html").read_text()
    for picture in (ROOT / "docs/gallery").glob("*.png"):
        if shown.count(f"_images/{picture.name}") < 2:
            found.append(f"the gallery has no thumbnail of {picture.name}, or no picture")
    return found


def main() -> int:
    can_fail()
    programs, output = map(pathlib.Path, sys.argv[1:])
    subprocess.run([ROOT / "docs/build", "--bin", programs, "--output", output], check=True)
    html = output / "html"
    wrong = broken(html) + unstyled(html) + plain(html) + missing(html, programs)
    print("\n".join(wrong) or f"{len(list(html.rglob('*.html')))} pages, all whole")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
