#!/usr/bin/env python3
"""Runs clang-tidy on our sources, a room at a time: what rooms include is then read once, not per file.

    tools/tidy.py BUILD [ROOM...]      BUILD has compile_commands.json; ROOM is core/complex, say

A room's sources are included in one file, with the options of all of them. A source that
cannot stand beside its neighbours (two helpers of one name) is to be told apart by another name.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import shlex
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
OURS = ("core", "server", "clients", "text")


def options(command: str) -> list[str]:
    """What a compiler's command says of the language and of where headers are."""
    words = shlex.split(command)
    kept = []
    for i, word in enumerate(words):
        if word == "-isystem":
            kept.append(word + words[i + 1])
        elif re.match(r"-(I|D|std=)", word):
            kept.append(word)
    return kept


def rooms(build: pathlib.Path) -> dict[str, tuple[list[str], list[pathlib.Path]]]:
    """By room: the options, and the sources."""
    found: dict[str, tuple[list[str], list[pathlib.Path]]] = {}
    for entry in json.loads((build / "compile_commands.json").read_text()):
        for source in sources_of(pathlib.Path(entry["file"])):
            if not source.is_relative_to(ROOT) or source.is_relative_to(build.resolve()):
                continue
            relative = source.relative_to(ROOT)
            if relative.parts[0] in OURS:
                given, sources = found.setdefault(str(relative.parent), ([], []))
                sources.append(source)
                given += [word for word in options(entry["command"]) if word not in given]
    return found


def sources_of(compiled: pathlib.Path) -> list[pathlib.Path]:
    """What it includes, if CMake bunched sources there."""
    if compiled.parent.name != "Unity":
        return [compiled]
    return [pathlib.Path(name) for name in re.findall(r'#include "(.*)"', compiled.read_text())]


def judge(room: str, given: list[str], sources: list[pathlib.Path], scratch: pathlib.Path) -> str:
    """What clang-tidy has to say; empty if nothing."""
    whole = scratch / (room.replace("/", "_") + ".cc")
    whole.write_text("".join(f'#include "{source}"\n' for source in sorted(sources)))
    command = ["clang-tidy-14", "--quiet", "--warnings-as-errors=*"]
    command += ["--checks=-bugprone-suspicious-include", str(whole), "--", *given]  # it is ours
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    said = done.stdout
    if done.returncode and not said.strip():
        said = done.stderr
    return said if done.returncode else ""


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("room", nargs="*")
    arguments = parser.parse_args()
    scratch = ROOT / "build" / "check" / "tidy"
    scratch.mkdir(parents=True, exist_ok=True)
    found = rooms(arguments.build.resolve())
    unknown = [room for room in arguments.room if room not in found]
    if unknown or not found:
        wrong = (
            f"no such room: {', '.join(unknown)}" if unknown else "nothing of ours is built there"
        )
        sys.exit(f"tidy: {wrong}; there are: {', '.join(sorted(found))}")
    chosen = {room: found[room] for room in arguments.room or found}
    failed = False
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        jobs = {pool.submit(judge, room, *given, scratch): room for room, given in chosen.items()}
        for job in concurrent.futures.as_completed(jobs):
            said = job.result()
            print(f"{jobs[job]}: {'' if said else 'nothing'}\n{said}".rstrip(), flush=True)
            failed = failed or bool(said)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
