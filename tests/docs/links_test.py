"""Every relative link of every page leads to a file and to a heading of it; every path in `code`, to a
file or a unit of the tree; every page that a source names is there."""

from __future__ import annotations

import pathlib
import re
import sys
from collections.abc import Iterator

from markdown_it import MarkdownIt
from markdown_it.token import Token

ROOT = pathlib.Path(__file__).resolve().parents[2]
_FOLDERS = "core|server|clients|tests|proto|docker|docs|packaging|tools|examples|cmake"
_MADE = {"docker/.env"}  # by users


_SKIPPED = {"build", "node_modules", "target", ".git"}  # what builds leave
_SOURCES = {".cc", ".h", ".proto", ".py", ".go", ".rs", ".rb", ".java", ".js", ".ts", ".R", ".sh"}


def _files() -> list[pathlib.Path]:
    return sorted(p for p in ROOT.rglob("*") if not _SKIPPED & set(p.relative_to(ROOT).parts))


def pages(files: list[pathlib.Path]) -> list[pathlib.Path]:
    return [path for path in files if path.suffix == ".md"]


def pages_not_there(source: str) -> list[str]:
    """The pages of docs/ that a source names, in a comment or a message."""
    named = set(re.findall(r"\bdocs/[\w/-]+\.md\b", source))
    return sorted(page for page in named if not (ROOT / page).exists())


def _tokens(text: str) -> Iterator[Token]:
    for token in MarkdownIt("commonmark").enable("table").parse(text):
        yield token
        yield from token.children or []


def links(text: str) -> list[str]:
    named = ("href", "src")
    found = [token.attrGet(name) for token in _tokens(text) for name in named]
    return [str(link) for link in found if link and not re.match(r"[a-z]+:", str(link))]


def anchors(text: str) -> set[str]:
    """As Git forges name headings."""
    headings = re.findall(r"(?m)^#+ +(.*?) *$", re.sub(r"(?ms)^```.*?^```", "", text))
    bare = [re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower() for heading in headings]
    return {re.sub(r"[^\w\- ]", "", heading).replace(" ", "-") for heading in bare}


def paths(text: str) -> list[str]:
    return [path for path in re.findall(rf"`((?:{_FOLDERS})/[\w./-]+)`", text) if path not in _MADE]


def broken(page: pathlib.Path, text: str) -> list[str]:
    found = [
        f"{page.relative_to(ROOT)}: there is no {path}"
        for path in paths(text)
        if not any((ROOT / f"{path}{end}").exists() for end in ("", ".h", ".cc", ".py"))
    ]
    for link in links(text):
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if not target.exists():
            found.append(f"{page.relative_to(ROOT)}: {link} leads nowhere")
            continue
        there = text if target == page else target.read_text() if target.suffix == ".md" else None
        if anchor and there is not None and anchor not in anchors(there):
            found.append(f"{page.relative_to(ROOT)}: {link} names no heading there")
    return found


def main() -> int:
    # That it can fail at all.
    made_up = "# A heading\n\n[a](#a-heading) [b](#no) [c](nowhere.md) [d](https://example.org)\n"
    made_up += "`core/mesher.h` `core/batch` `core/nothing.h`\n"
    assert len(broken(ROOT / "README.md", made_up)) == 3
    assert pages_not_there("// see docs/no.md and docs/index.md") == ["docs/no.md"]
    files = _files()
    found = [line for page in pages(files) for line in broken(page, page.read_text())]
    for source in (
        path for path in files if path.suffix in _SOURCES and path.name != "links_test.py"
    ):
        absent = pages_not_there(source.read_text(errors="replace"))
        found += [f"{source.relative_to(ROOT)}: there is no {page}" for page in absent]
    print("\n".join(found) or f"{len(pages(files))} pages, no broken link")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
