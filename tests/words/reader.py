"""Finds words of a table in sources and pages, however they are written: `WatchLog`, `watch_log`, `kWatchLog`
and "watch log" are one."""

from __future__ import annotations

import bisect
import io
import pathlib
import re
import subprocess
import tokenize
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import tomllib

SOURCES = {".cc", ".cpp", ".go", ".h", ".java", ".mjs", ".py", ".R", ".rb", ".rs", ".ts"}
PROSE = {".h", ".md", ".proto"}  # sentences that users and newcomers read
PACKAGE = re.compile(
    r"clients/python/stellate/(?!oracles/|solids/|_walls)"
)  # so is what help() shows
CLIENTS = re.compile(
    r"clients/(go/\w+(?<!_test)\.go|java/src/main/|node/src/|rust/src/|ruby/lib/|r/R/)"
)
_HASHES = re.compile(r"#.*")
_SLASHES = re.compile(r"//[^\n]*|/\*.*?\*/", re.S)
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[.;:,!?()\"|=<>{}]")
_STRING = re.compile(r'"(?:[^"\\\n]|\\.)*"')
_STRINGS = re.compile(rf"{_STRING.pattern}(?:\s*{_STRING.pattern})*")


@dataclass(frozen=True)
class Word:
    """What is not to be said, in all its forms, and what to say instead."""

    old: tuple[str, ...]
    new: str
    where: tuple[str, ...] = ()  # folders; empty: everywhere
    unless: tuple[str, ...] = ()  # longer expressions in which it is right


@dataclass(frozen=True)
class Table:
    names: tuple[Word, ...]  # of things: refused in identifiers, comments, messages and pages
    phrases: tuple[Word, ...]  # refused in the comments of headers, messages, proto and pages


@dataclass(frozen=True)
class Hit:
    line: int
    old: str
    new: str


def lies_in(path: str, folder: str) -> bool:
    return path == folder or path.startswith(folder + "/")


def read_table(path: pathlib.Path) -> Table:
    table = tomllib.loads(path.read_text())

    def words(kind: str) -> tuple[Word, ...]:
        return tuple(
            Word(
                tuple(one["old"]),
                one["new"],
                tuple(one.get("in", ())),
                tuple(one.get("unless", ())),
            )
            for one in table[kind]
        )

    return Table(words("name"), words("phrase"))


class Text:
    """A text as the sequence of its words, lower case; punctuation stands between them."""

    def __init__(self, text: str):
        self.starts, self.places, parts, length = [], [], [" "], 1
        for match in _WORD.finditer(text):
            word = match[0].lower()
            self.starts.append(length - 1)
            self.places.append(match.start())
            parts.append(word + " ")
            length += len(word) + 1
        self.words = "".join(parts)
        self.ends = [i for i, c in enumerate(text) if c == "\n"]

    def find(self, expression: str) -> Iterator[tuple[int, int]]:
        """Where it begins, in `words`, and in which line of the text."""
        at = self.words.find(f" {expression} ")
        while at >= 0:
            place = self.places[bisect.bisect_left(self.starts, at)]
            yield at, bisect.bisect_left(self.ends, place) + 1
            at = self.words.find(f" {expression} ", at + 1)


def find(text: Text, path: str, words: Iterable[Word]) -> list[Hit]:
    hits = []
    for word in words:
        if word.where and not any(lies_in(path, folder) for folder in word.where):
            continue
        right = [
            range(at, at + len(longer) + 1) for longer in word.unless for at, _ in text.find(longer)
        ]
        for old in word.old:
            for at, line in text.find(old):
                if not any(at in reach for reach in right):
                    hits.append(Hit(line, old, word.new))
    return hits


def messages(source: str) -> str:
    """The strings of a source in C++, each in its lines; those that stand together are one."""
    kept = re.sub(r"[^\n]", " ", source)
    for match in _STRINGS.finditer(source):
        # Quotes and newlines within one message are no stops.
        said = re.sub(r'\\n|"', lambda m: " " * len(m[0]), match[0])
        kept = kept[: match.start()] + "|" + said[1:] + kept[match.end() :]
    return kept


def words_of_python(source: str) -> str:
    """The docstrings, messages and comments of a source in Python, each in its lines."""
    lines = [" " * len(line) for line in source.split("\n")]
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type in (tokenize.STRING, tokenize.COMMENT):
            for at, line in enumerate(token.string.split("\n"), start=token.start[0] - 1):
                begin = token.start[1] if at == token.start[0] - 1 else 0
                lines[at] = lines[at][:begin] + line + lines[at][begin + len(line) :]
    return "\n".join(lines)


def comments(source: str, suffix: str) -> str:
    """The comments of a source of another client, each in its lines."""
    kept = re.sub(r"[^\n]", " ", source)
    for match in (_HASHES if suffix in {".R", ".rb"} else _SLASHES).finditer(source):
        kept = kept[: match.start()] + match[0] + kept[match.end() :]
    return kept


def check(path: str, content: str, table: Table) -> list[Hit]:
    """What a file says that it should not."""
    suffix = pathlib.PurePosixPath(path).suffix
    text = Text(content)
    hits = find(text, path, table.names) if suffix in SOURCES | PROSE else []
    if path.startswith("tests/"):
        return hits
    if suffix in PROSE:
        hits += find(text, path, table.phrases)
    elif suffix == ".cc":
        hits += find(Text(messages(content)), path, table.phrases)
    elif suffix == ".py" and PACKAGE.match(path):
        hits += find(Text(words_of_python(content)), path, table.phrases)
    elif CLIENTS.match(path):
        hits += find(Text(comments(content, suffix)), path, table.phrases)
    return hits


def tracked(root: pathlib.Path) -> list[str]:
    """The repository's files; where it is no clone, those that are there."""
    command = ["git", "-c", f"safe.directory={root}", "-C", root, "ls-files", "-z"]
    done = subprocess.run(command, capture_output=True, text=True)
    names = done.stdout.split("\0") if done.returncode == 0 else []
    names = names or [
        path.relative_to(root).as_posix()
        for top in ("clients", "core", "docs", "examples", "proto", "server", "tests", "text")
        for path in sorted((root / top).rglob("*"))
    ]
    return [
        name
        for name in names
        if pathlib.PurePosixPath(name).suffix in SOURCES | PROSE and (root / name).is_file()
        and "_generated" not in name and "node_modules" not in name
    ]  # fmt: skip
