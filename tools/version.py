#!/usr/bin/python3 -B
"""Sets the version of this tree: in VERSION, and in the files of other tools, which cannot read that.

    tools/version.py 0.2.0

CHANGELOG.md, whose topmost heading names the version too, is for people to write.
"""

from __future__ import annotations

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
# Each file with an expression whose group is the version, or the part of it that has to be the same.
_NPM_LOCK = (
    r'\A\{\s*"name": "[\w-]+",\s*"version": "(\S+)"|"": \{\s*"name": "[\w-]+",\s*"version": "(\S+)"'
)
STATED = {
    "CITATION.cff": r"\nversion: (\S+)",
    "clients/java/README.md": r"`[\w.]+:stellate:(\S+)`",
    "clients/java/pom.xml": r"<artifactId>stellate</artifactId>\s*<version>(\S+)</version>",
    "clients/node/package-lock.json": _NPM_LOCK,
    "clients/node/package.json": r'"version": "(\S+)"',
    "clients/r/DESCRIPTION": r"\nVersion: (\S+)",
    "clients/ruby/stellate.gemspec": r"gem\.version = '(\S+)'",
    "clients/rust/Cargo.lock": r'name = "stellate"\nversion = "(\S+)"',
    "clients/rust/Cargo.toml": r'\nversion = "(\S+)"',
    "clients/view/package-lock.json": _NPM_LOCK,
    "clients/view/package.json": r'"version": "(\S+)"',
    "docker/Dockerfile": r"\bstellate:(\d\S*)",
    "docker/alone.yaml": r"image: stellate:(\S+)",
    "docker/compose.yaml": r"image: stellate[\w-]*:(\S+)",
    "docker/helm/stellate/Chart.yaml": r'\n(?:version: |appVersion: ")([\d.]+)',
    "docker/kubernetes/kustomization.yaml": r"name: stellate[\w-]*\n    newTag: (\S+)",
    "docs/using/building.md": r"find_package\(stellate (\S+)",
    "examples/CMakeLists.txt": r"find_package\(stellate (\S+)",
    "tests/clients/cpp/report_test.cc": r'\("version": "(\S+)"\}\)',
    "tests/consumer/run": r"find_package\(stellate (\d\S*)",
}


def stated(path: str, text: str) -> list[re.Match[str]]:
    """Where a file says the version."""
    return list(re.finditer(STATED[path], text))


def with_version(path: str, text: str, version: str) -> str:
    """The file's text with that version, in as many numbers as it says."""
    for match in reversed(stated(path, text)):
        group = match.lastindex or 1
        numbers = match[group].count(".") + 1
        begin, end = match.span(group)
        text = text[:begin] + ".".join(version.split(".")[:numbers]) + text[end:]
    return text


def main() -> int:
    """The exit status."""
    if len(sys.argv) != 2 or not re.fullmatch(r"\d+\.\d+\.\d+", sys.argv[1]):
        print(__doc__)
        return 2
    for path in STATED:
        text = (ROOT / path).read_text()
        (ROOT / path).write_text(with_version(path, text, sys.argv[1]))
    (ROOT / "VERSION").write_text(sys.argv[1] + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
