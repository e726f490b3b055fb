"""Every relative link of every page leads to a file and to a heading of it; every path in `code`, to a
file or a unit of the tree."""

from __future__ import annotations

import pathlib
import re
import sys
from collections.abc import Iterator

from markdown_it import MarkdownIt
from markdown_it.token import Token

ROOT = pathlib.Path(__file__).resolve().parents[2]
_FOLDERS = "core|server|clients|tests|proto|docker|packaging|tools|examples|cmake"
_MADE = {"docker/.env"}  # by users


def pages() -> list[pathlib.Path]:
    """What the repository has in Markdown, without what builds leave there."""
    skipped = {"build", "node_modules", "target", ".git"}
    found = sorted(ROOT.rglob("*.md"))
    return [page for page in found if not skipped & set(page.relative_to(ROOT).parts)]


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
    found = [line for page in pages() for line in broken(page, page.read_text())]
    print("\n".join(found) or f"{len(pages())} pages, no broken link")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
