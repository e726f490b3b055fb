"""Writes the pages of the reference from the code: the protocol from its comments, command lines and
settings from the programs' own words, metrics from a server's, headers and package by name.

Usage: reference.py FOLDER BIN XML    BIN: where stellated and stellate are; XML: Doxygen's
"""

from __future__ import annotations

import importlib
import os
import pathlib
import pkgutil
import re
import socket
import subprocess
import sys
import tempfile
import time
import types
import urllib.request

import headers
import protocol

ROOT = pathlib.Path(__file__).resolve().parents[2]


def said(*command: str) -> str:
    """What a program says of itself, and names itself as users call it."""
    ours = os.pathsep.join(str(ROOT / "clients" / package) for package in ("python", "conform"))
    package = {"PYTHONPATH": ours, "COLUMNS": "96"}
    done = subprocess.run(
        [*command, "--help"], capture_output=True, text=True, check=True,
        env={**os.environ, **package},
    )  # fmt: skip
    return re.sub(r"\S*/bin/(?=stellated?\b)", "", done.stdout).rstrip()


def block(text: str) -> str:
    return f"```text\n{text}\n```\n"


def command_lines(programs: pathlib.Path) -> str:
    stellate = str(programs / "stellate")
    listed = said(stellate).partition("Subcommands:")[2]
    commands = re.findall(r"(?m)^  (\w+) ", listed)
    page = ["# Command lines\n", "What the programs say of themselves with `--help`.\n"]
    page += ["## stellate\n", block(said(stellate))]
    for command in commands:
        page += [f"### stellate {command}\n", block(said(stellate, command))]
    python = ["/usr/bin/python3", "-m", "stellate"]
    page += ["## python3 -m stellate\n", block(said(*python))]
    for command in re.findall(r"(?m)^    (\w+)  ", said(*python)):
        page += [f"### python3 -m stellate {command}\n", block(said(*python, command))]
    page += ["## stellated\n", block(said(str(programs / "stellated")))]
    return "\n".join(page)


def settings(programs: pathlib.Path) -> str:
    printed = subprocess.run(
        [str(programs / "stellated"), "--print-config"], capture_output=True, text=True, check=True
    ).stdout
    return (
        "# Settings of the server\n\nWhat `stellated --print-config` prints: every setting with its "
        "default. Each is a flag, too: `--max-meshes 8` for `max-meshes = 8`; "
        "[operations](../docs/running/operations.md) says which wins.\n\n"
        f"```ini\n{printed.rstrip()}\n```\n"
    )


def metrics(programs: pathlib.Path) -> str:
    """Of a server that has just begun: those that come with their first event are in its page."""
    with tempfile.TemporaryDirectory() as folder:
        ready = pathlib.Path(folder) / "ready"
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        server = subprocess.Popen(
            [str(programs / "stellated"), "--listen", f"unix:{folder}/socket",
             "--metrics-listen", f"127.0.0.1:{port}", "--ready-file", str(ready)],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        try:
            while not ready.exists():
                if server.poll() is not None:
                    raise RuntimeError(f"stellated: {server.stderr.read()}")
                time.sleep(0.02)
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics") as answer:
                text = answer.read().decode()
        finally:
            server.kill()
            server.wait()
    helps = dict(re.findall(r"(?m)^# HELP (\S+) (.*)$", text))
    kinds = dict(re.findall(r"(?m)^# TYPE (\S+) (\S+)$", text))
    rows = [f"| `{name}` | {kinds[name]} | {helps[name]} |" for name in kinds]
    return (
        "# Metrics\n\nAs a server tells them at `/metrics`; what to watch: "
        "[metrics](../docs/running/metrics.md).\n\n| Metric | Kind | What |\n|---|---|---|\n"
        + "\n".join(rows) + "\n"
    )  # fmt: skip


def offered(module: types.ModuleType, above: set[str]) -> list[str]:
    """What a module of the package has, but for what is `above` already."""
    page = ["```{eval-rst}", f".. automodule:: {module.__name__}", "   :no-members:\n"]
    for name in sorted(module.__all__, key=lambda n: (n[0].isupper(), n.lower())):
        subject = getattr(module, name)
        if name in above or isinstance(subject, types.ModuleType):
            continue
        if isinstance(subject, type) and issubclass(subject, (Exception, KeyboardInterrupt)):
            kind = "autoexception"
        else:
            kind = "autoclass" if isinstance(subject, type) else "autofunction"
        page.append(f".. {kind}:: {module.__name__}.{name}")
    return [*page, "```\n"]


def package() -> str:
    sys.path.insert(0, str(ROOT / "clients" / "python"))
    import stellate

    page = ["# Python\n", *offered(stellate, set())]
    for _, name, _ in pkgutil.iter_modules(stellate.__path__, "stellate."):
        module = None if "._" in name else importlib.import_module(name)
        top = set(stellate.__all__)
        if module is not None and set(getattr(module, "__all__", ())) - top:
            page += [f"## {name}\n", *offered(module, top)]
    return "\n".join(page)


def main() -> int:
    folder, programs, xml = map(pathlib.Path, sys.argv[1:])
    folder.mkdir(parents=True, exist_ok=True)
    pages = {
        "python": package(),
        "cpp": headers.page(xml),
        "protocol": protocol.page(ROOT / "proto"),
        "command-lines": command_lines(programs),
        "settings": settings(programs),
        "metrics": metrics(programs),
    }
    listed = "\n".join(pages)
    pages["index"] = (
        "# Reference\n\nGenerated from the code, when this site was built.\n\n"
        f"```{{toctree}}\n:maxdepth: 2\n\n{listed}\n```\n"
    )
    for name, text in pages.items():
        file = folder / f"{name}.md"
        if not file.exists() or file.read_text() != text:  # Sphinx builds anew what is newer
            file.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
