"""Holds every `#include` and every Python import against a table of rooms.

A room is a folder, or one file: its files are those below it that no longer entry of the table
holds. The table says from which rooms each room may take.
"""

from __future__ import annotations

import ast
import pathlib
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

SOURCES = {".h", ".cc", ".cpp", ".in", ".py"}
# What the C library rounds as the processor has it, by whatever name it is called.
INEXACT = re.compile(
    r"(?:\bstd::|\.|(?<![\w:>])::|(?<![\w:>.]))"
    r"(a?(?:sin|cos|tan)h?|atan2|exp2?|expm1|log(?:2|10|1p)?|pow|hypot|cbrt|erfc?|[lt]gamma|fma)[fl]?"
    r"\s*\(|std::(normal_distribution|exponential_distribution)\b"
)
COMMENT = re.compile(r"//[^\n]*")
INCLUDE = re.compile(r'^\s*#\s*include\s+(?:"([^"]+)"|<([^>]+)>)', re.MULTILINE)


@dataclass(frozen=True)
class Table:
    rooms: Mapping[str, tuple[str, ...]]  # room: the rooms that it may take from
    # What comes from elsewhere: how its headers or modules begin, and who may have it. A name that
    # ends in "/" stands for all that begin so.
    foreign: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    generated: Mapping[str, str] = field(default_factory=dict)  # include prefix: room
    packages: Mapping[str, str] = field(default_factory=dict)  # Python package: its folder
    watched: tuple[str, ...] = ()  # folders of which every source must be in a room
    # Folders whose results must be the same on every processor, and their files that may round.
    exact: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    acyclic: tuple[str, ...] = ()  # folders whose files must not take from each other in a circle


@dataclass(frozen=True)
class Take:
    """One line that takes from another file, or from elsewhere."""

    line: int
    words: str  # as it stands
    file: str | None  # that it names, within the tree
    now: bool = True  # when the file is read, not for the type checker alone or in a function


def lies_in(path: str, folder: str) -> bool:
    return path == folder or path.startswith(folder + "/")


class Tree:
    def __init__(self, root: pathlib.Path, table: Table):
        self.root, self.table = root, table
        tops = sorted({room.split("/")[0] for room in [*table.rooms, *table.watched]})
        self.files = [
            path.relative_to(root).as_posix()
            for top in tops
            for path in sorted((root / top).rglob("*"))
            if path.suffix in SOURCES and path.is_file() and "_generated" not in path.parts
        ]
        self.by_name: dict[str, list[str]] = {}
        for file in self.files:
            self.by_name.setdefault(file.rsplit("/", 1)[-1], []).append(file)
        self.known = set(self.files)

    def room_of(self, file: str) -> str | None:
        inside = [room for room in self.table.rooms if lies_in(file, room)]
        return max(inside, key=len, default=None)

    def find_header(self, file: str, name: str) -> str | None:
        beside = (pathlib.PurePosixPath(file).parent / name).as_posix()
        for path in (beside, name):
            if path in self.known:
                return path
        # By one of the folders that the build adds: the one that shares most with the file.
        ends = [
            path
            for path in self.by_name.get(name.rsplit("/", 1)[-1], [])
            if path.endswith("/" + name)
        ]
        return max(ends, key=lambda path: common(path, file), default=None)

    def takes_of_cpp(self, file: str, text: str) -> Iterator[Take]:
        for match in INCLUDE.finditer(text):
            quoted, angled = match.groups()
            line = text.count("\n", 0, match.start(1 if quoted else 2)) + 1
            yield Take(line, quoted or angled, quoted and self.find_header(file, quoted))

    def find_module(self, dotted: str) -> str | None:
        """The file of a module by its full name, or None: not of this tree."""
        for package, folder in self.table.packages.items():
            if dotted == package or dotted.startswith(package + "."):
                path = folder + dotted[len(package) :].replace(".", "/")
                for end in (".py", "/__init__.py"):
                    if path + end in self.known:
                        return path + end
        return None

    def module_of(self, file: str) -> list[str]:
        """The package that a file lies in, as names; empty: in none."""
        for package, folder in self.table.packages.items():
            if lies_in(file, folder):
                return [package, *file[len(folder) + 1 :].split("/")[:-1]]
        return []

    def takes_of_python(self, file: str, text: str) -> Iterator[Take]:
        here = self.module_of(file)
        for node, now in statements(ast.parse(text, file)):
            if isinstance(node, ast.Import):
                for alias in node.names:
                    yield Take(node.lineno, alias.name, self.find_module(alias.name), now)
            elif isinstance(node, ast.ImportFrom):
                base = node.module.split(".") if node.module else []
                if node.level:
                    base = here[: len(here) - node.level + 1] + base
                for alias in node.names:
                    whole = ".".join([*base, alias.name])
                    found = self.find_module(whole) or self.find_module(".".join(base))
                    yield Take(node.lineno, whole, found, now)

    def takes(self, file: str) -> list[Take]:
        text = (self.root / file).read_text(encoding="utf-8")
        if file.endswith(".py"):
            return list(self.takes_of_python(file, text))
        return list(self.takes_of_cpp(file, text))


def faults_of_rounding(tree: Tree, file: str) -> Iterator[str]:
    """What makes a result hang on the processor, where it must not."""
    folders = [folder for folder in tree.table.exact if lies_in(file, folder)]
    if not folders or any(file in tree.table.exact[folder] for folder in folders):
        return
    text = COMMENT.sub("", (tree.root / file).read_text(encoding="utf-8"))
    for match in INEXACT.finditer(text):
        line = text.count("\n", 0, match.start()) + 1
        yield (
            f"{file}:{line}: {match[1] or match[2]} is rounded as the processor has it: take + - * / "
            "and sqrt (core/base/random.h, core/base/power.h), or the mesh is another elsewhere"
        )


def statements(tree: ast.AST, now: bool = True) -> Iterator[tuple[ast.AST, bool]]:
    for node in ast.iter_child_nodes(tree):
        yield node, now
        typing_only = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
        in_function = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        yield from statements(node, now and not typing_only and not in_function)


def common(one: str, other: str) -> int:
    pairs = zip(one.split("/"), other.split("/"))
    return next((i for i, (a, b) in enumerate(pairs) if a != b), 0)


def circle(edges: Mapping[str, Iterable[str]]) -> list[str]:
    """Some circle, its first node again at its end; empty: there is none."""
    done: set[str] = set()

    def walk(node: str, way: list[str]) -> list[str]:
        if node in way:
            return [*way[way.index(node) :], node]
        if node not in done:
            for after in edges.get(node, ()):
                if found := walk(after, [*way, node]):
                    return found
            done.add(node)
        return []

    return next((found for node in edges if (found := walk(node, []))), [])


def faults_of_table(tree: Tree) -> Iterator[str]:
    rooms = tree.table.rooms
    for room, takes in rooms.items():
        if not any(tree.room_of(file) == room for file in tree.files) and (
            room not in tree.table.generated.values()
        ):
            yield f"the table has a room {room}, and no source is in it"
        for other in takes:
            if other not in rooms:
                yield f"{room} may take from {other}, which is no room of the table"
    if found := circle(rooms):
        yield "the table goes in a circle: " + " -> ".join(found)


def foreign_owner(table: Table, name: str) -> str | None:
    fits = [
        key
        for key in table.foreign
        if name == key or (key.endswith(("/", ".")) and (name + key[-1]).startswith(key))
    ]
    return max(fits, key=len, default=None)


def fault_of(tree: Tree, file: str, room: str, take: Take) -> str | None:
    table = tree.table
    made = max(
        (key for key in table.generated if take.words.startswith(key)), key=len, default=None
    )
    target = tree.room_of(take.file) if take.file else (table.generated[made] if made else None)
    if target:
        if target == room or target in table.rooms[room]:
            return None
        return f"takes {take.words}, of {target}, and {room} may not"
    if take.file:
        return f"takes {take.words}, which is in no room"
    if owner := foreign_owner(table, take.words):
        if any(lies_in(room, holder) for holder in table.foreign[owner]):
            return None
        return f"takes {take.words}, and only {', '.join(table.foreign[owner])} may have {owner}"
    return None


def faults(root: pathlib.Path, table: Table) -> list[str]:
    """What is wrong, each with its file and line; empty: every wall stands."""
    tree = Tree(root, table)
    found = list(faults_of_table(tree))
    edges: dict[str, list[str]] = {}
    for file in tree.files:
        room = tree.room_of(file)
        if room is None:
            if any(lies_in(file, folder) for folder in table.watched):
                found.append(f"{file}: is in no room of the table")
            continue
        found.extend(faults_of_rounding(tree, file))
        for take in tree.takes(file):
            if wrong := fault_of(tree, file, room, take):
                found.append(f"{file}:{take.line}: {wrong}")
            if take.file and take.now and any(lies_in(file, folder) for folder in table.acyclic):
                edges.setdefault(file, []).append(take.file)
    if files := circle(edges):
        found.append("these take from each other: " + " -> ".join(files))
    return found
