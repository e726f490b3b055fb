"""Blocks of commands, and what else is run as a program."""

from __future__ import annotations

import os
import pathlib
import re
import shlex
import signal
import subprocess
from typing import Any

import tomllib
import yaml
from blocks import ROOT, Block, Wrong
from surroundings import BUILD, PATIENCE, Surroundings

_EXCEPTIONS = ("background", "leave_out", "status")
# A line that goes on as in another terminal has said what it says, or the block has failed.
_AWAIT = """
await() {  # LOG PROCESS TEXT
  until grep -qsF -- "$3" "$1"; do
    kill -0 "$2" 2>/dev/null || { cat "$1"; return 1; }
    sleep 0.02
  done
}
"""
_OURS = r"\.ci|clients|docker|docs|gallery|packaging|tests|tools"  # folders of programs
_SHOWN = 60  # lines of what failed


def must(command: list[str], around: Surroundings, text: str | None = None) -> str:
    """What a program prints. It and all that it started have ended when this returns.

    Raises: Wrong, with all that it printed, unless its status is 0.
    """
    process = subprocess.Popen(
        command, cwd=around.here, env=around.environment(), text=True, start_new_session=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    try:
        printed, _ = process.communicate(text, timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        raise Wrong(f"it does not end. It printed:\n{_end(process.communicate()[0])}") from None
    finally:
        try:
            os.killpg(process.pid, signal.SIGKILL)  # what it left running
        except ProcessLookupError:
            pass
    if process.returncode:
        raise Wrong(f"status {process.returncode}. It printed:\n{_end(printed)}")
    return printed


def _end(printed: str) -> str:
    return "\n".join(printed.splitlines()[-_SHOWN:])


def python(before: str, text: str, around: Surroundings) -> None:
    """The block, after what the page takes for granted."""
    (around.here / "block.py").write_text(before + "\n" + text)
    must(["python3", "block.py"], around)


def commands(text: str) -> list[str]:
    """A block's commands: lines, with those that go on after them."""
    found: list[str] = []
    begun = ""
    for line in text.splitlines():
        begun += line + "\n"
        if line.endswith("\\"):
            continue
        test = subprocess.run(["bash", "-n"], input=begun, capture_output=True, text=True)
        if test.returncode == 0 and "here-document" not in test.stderr:
            found.append(begun)
            begun = ""
    if begun.strip():
        raise Wrong(f"these are no commands:\n{begun}")
    return found


def run(before: str, text: str, entry: dict[str, Any], around: Surroundings) -> None:
    """As bash runs it: all of its commands have to go well."""
    script = ["set -euo pipefail", _AWAIT, before]
    unused = {start for key in _EXCEPTIONS for start in entry.get(key, ())}
    for number, command in enumerate(commands(text)):
        log = f".block-{number}.log"
        key, start = next(
            ((key, start) for key in _EXCEPTIONS for start in entry.get(key, ())
             if command.lstrip().startswith(start)), ("", ""))  # fmt: skip
        unused.discard(start)
        if key == "background":
            says = shlex.quote(entry[key][start])
            script.append(f"rm -f {log}\n{{ exec {command}}} >{log} 2>&1 &\nawait {log} $! {says}")
        elif key == "status":
            script.append(
                f"status=0\n{{ {command}}} || status=$?\n[[ $status == {entry[key][start]} ]]"
            )
        elif not key:
            script.append(command)
    if unused:
        raise Wrong(f"no command of the block begins with {sorted(unused)}")
    (around.here / "block.sh").write_text("\n".join(script))
    must(["bash", "block.sh"], around)


def check(block: Block, around: Surroundings) -> None:
    """What can be said of a block that is not run."""
    text = around.fill_in(block.entry, block.text)
    try:
        if block.kind == "bash":
            for command in commands(text):
                programs_exist(command)
        elif block.kind == "python":
            compile(text, "block", "exec")
        elif block.kind == "toml":
            tomllib.loads(text)
        elif block.kind == "yaml":
            list(yaml.safe_load_all(text))
    except (SyntaxError, ValueError, yaml.YAMLError) as error:
        raise Wrong(f"no {block.kind}: {error}") from None


def programs_exist(command: str) -> None:
    """Ours, with the options that they are given; and the targets of the build.

    Raises: Wrong.
    """
    words = shlex.split(command, comments=True)
    program = None
    for word in words:
        ours = re.fullmatch(rf"(?:\./)?((?:{_OURS})/[\w./-]+)", word)
        if ours:
            path = ROOT / ours[1]
            if not path.exists():
                raise Wrong(f"there is no {word}")
            if path.is_file() and (path.suffix == ".py" or os.access(path, os.X_OK)):
                program = path
        elif word in ("&&", "||", "|", ";"):
            program = None
        option = re.match(r"(--[a-z-]+)(=|$)", word)
        if program and option and not _has_option(program, option[1]):
            raise Wrong(f"{program.relative_to(ROOT)} has no option {option[1]}")
        if built := re.fullmatch(r"build/release/bin/(\w+)", word):
            _target_exists(built[1])
    if words[:2] == ["cmake", "--build"] and "--target" in words:
        for target in words[words.index("--target") + 1 :]:
            _target_exists(target)


def _has_option(program: pathlib.Path, option: str) -> bool:
    """Whether its text has it, or that of a program in Python below it that it starts."""
    text = program.read_text()
    started = (source for source in program.parent.rglob("*.py") if source.name in text)
    name = rf"(?<![\w-]){option}(?![\w-])"
    return any(re.search(name, part) for part in (text, *(s.read_text() for s in started)))


def _target_exists(target: str) -> None:
    """In the build, or in a room that an option adds and that this build may be without.

    Raises: Wrong.
    """
    targets = subprocess.run(
        ["cmake", "--build", str(BUILD), "--target", "help"], capture_output=True, text=True
    )
    in_build = re.search(rf"^{re.escape(target)}: ", targets.stdout, re.M)
    if not in_build and not _is_optional(target):
        raise Wrong(f"the build has no target {target}")


def _is_optional(target: str) -> bool:
    """Whether a room that the root's CMakeLists.txt adds only by an option makes it."""
    added = re.findall(
        r"^ +add_subdirectory\(([\w/]+)\)", (ROOT / "CMakeLists.txt").read_text(), re.M
    )
    makes = re.compile(rf"add_(executable|library)\({re.escape(target)}\s")
    return any(makes.search((ROOT / room / "CMakeLists.txt").read_text()) for room in added)
