"""The code blocks of a page, and what its table says is to be done with each.

A page is a Markdown file for users. Its table, pages/NAME.toml, where NAME is the page's path with _
for / (README.toml, docs_clients.toml), has an entry for each of its fenced and indented blocks, in
their order:

    [[block]]
    starts = "stellate download"      # how the block's first line begins
    run = "bash"                      # or python, config, promql, cpp: it is run as it stands; or
                                      # output: what the block before it printed

    servers = ["plain", "tls"]        # who listens meanwhile: surroundings.py says where
    certificates = true               # the files of "tls", but no server
    before = '''name = "{mesh}"'''    # what the page takes for granted: code of the same language
    files = { "a.py" = "..." }        # files that it takes for granted
    replace = { "meshes/6f1c..." = "{mesh}" }   # placeholders; {mesh} is a mesh on the server
    background = { "stellated" = "listening on" }   # lines that begin so go on, as in another
                                      # terminal, once they have said that
    leave_out = { "tests/run" = "why" }         # lines that begin so do not run here, and why
    status = { "tests/x" = 1 }        # lines that begin so are to end with another status than 0
    leaves = ["torus.vtu"]            # files that are to be there afterwards

or, for a block that cannot run here,

    check = "bash"                    # or python, toml, yaml, text: its syntax is checked, and that
    reason = "takes an hour"          # the programs of ours and the targets that it names exist

At the top of a table, `paths = { "/etc/stellate" = "etc" }` has the page's blocks write into their
scratch folder what would go there, and `fresh = true` gives them a source tree in which nothing is
built. With `session = true` all Python blocks run in one interpreter, one after the other, and a block of
kind `output` may follow each (session.py says what has to agree). With `service = true` systemctl starts and stops what packaging/install installs, in `root`.
"""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Any

import tomllib
from markdown_it import MarkdownIt

ROOT = pathlib.Path(__file__).resolve().parents[2]
TABLES = pathlib.Path(__file__).resolve().parent / "pages"
RUNS = ("bash", "python", "output", "config", "promql", "cpp")
CHECKS = ("bash", "python", "toml", "yaml", "text")
_KEYS = {
    "starts", "run", "check", "reason", "servers", "before", "files", "replace", "background",
    "leave_out", "status", "leaves", "certificates",
}  # fmt: skip


class Wrong(Exception):
    """A page and its table do not fit, or a block does not do what it says. In words."""


@dataclasses.dataclass
class Block:
    """One block: where its text begins, the language its fence names, what to do with it."""

    line: int
    language: str
    text: str
    entry: dict[str, Any]

    @property
    def kind(self) -> str:
        return self.entry.get("run") or self.entry["check"]


@dataclasses.dataclass
class Page:
    """A page with its table: all of its blocks have an entry, all entries a block."""

    path: str
    table: dict[str, Any]
    blocks: list[Block]


def pages() -> list[str]:
    """All that users read, from the root of the repository."""
    found = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "clients/python/README.md")]
    found += sorted((ROOT / "docs").rglob("*.md"))
    return [str(page.relative_to(ROOT)) for page in found]


def table_of(path: str) -> pathlib.Path:
    """Where a page's table is."""
    return TABLES / (path.removesuffix(".md").replace("/", "_") + ".toml")


def read(path: str) -> Page:
    """Raises: Wrong, with all that does not fit."""
    table_path = table_of(path)
    where = table_path.relative_to(ROOT)
    table = tomllib.loads(table_path.read_text()) if table_path.exists() else {}
    return match(path, (ROOT / path).read_text(), table, str(where))


def match(path: str, text: str, table: dict[str, Any], where: str) -> Page:
    """Each block takes the first entry left whose `starts` its first line begins with."""
    entries = list(table.get("block", []))
    wrong = [problem for entry in entries for problem in _problems(entry, where)]
    blocks = []
    for token in MarkdownIt("commonmark").parse(text):
        if token.type not in ("fence", "code_block"):
            continue
        if token.info.startswith("{literalinclude}"):
            continue  # a file, which has its own test
        line = token.map[0] + (2 if token.type == "fence" else 1)
        first = token.content.lstrip("\n").split("\n")[0].strip()
        entry = next((e for e in entries if first.startswith(e.get("starts", "\0"))), None)
        if entry is None:
            wrong.append(_unknown(path, line, first, token.info, where))
            continue
        entries.remove(entry)
        blocks.append(Block(line, token.info, token.content, entry))
    for entry in entries:
        wrong.append(
            f"{where}: no block of {path} is left that begins with {entry.get('starts')!r}"
        )
    if wrong:
        raise Wrong("\n".join(wrong))
    return Page(path, table, blocks)


def _problems(entry: dict[str, Any], where: str) -> list[str]:
    name = f"{where}: the entry {entry.get('starts')!r}"
    wrong = [f"{name} has an unknown key {key!r}" for key in sorted(entry.keys() - _KEYS)]
    if not entry.get("starts"):
        wrong.append(f"{name} does not say how its block `starts`")
    if ("run" in entry) == ("check" in entry):
        wrong.append(f"{name} has to have either `run` or `check`")
    elif entry.get("run", "bash") not in RUNS or entry.get("check", "bash") not in CHECKS:
        wrong.append(f"{name}: `run` is one of {RUNS}, `check` one of {CHECKS}")
    elif "check" in entry and not entry.get("reason"):
        wrong.append(f"{name} has to give the `reason` why its block is not run")
    return wrong


def _unknown(path: str, line: int, first: str, language: str, where: str) -> str:
    kind = {"sh": "bash", "shell": "bash", "": "bash"}.get(language, language)
    return (
        f"{path}:{line}: nothing says how to run this block. Append to {where}, in the page's order:\n"
        f"    [[block]]\n    starts = '''{first[:60]}'''\n    run = \"{kind}\"\n"
        f"(what else an entry may say, and how to give the reason why a block cannot run: "
        f"tests/docs/blocks.py; then: tests/docs/run {path})"
    )
