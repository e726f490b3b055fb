#!/usr/bin/python3 -B
"""Writes what identity.toml says into the metadata of all packages, whose tools cannot read that.

    tools/identity.py

A new home page, address or group is changed there, and this is run. The suite holds that all agree.
"""

from __future__ import annotations

import pathlib
import re
import sys
from typing import Any

import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[1]

_PERSON = "{maintainer} <{email}>"
_PYPROJECT = (
    (r'\nlicense = \{text = "(.*)"\}', "{licence}"),
    (r'\nauthors = \[\{name = "(.*?)"', "{maintainer}"),
    (r'\nauthors = \[.*email = "(.*?)"', "{email}"),
    (r'\nHomepage = "(.*)"', "{home}"),
    (r'\nSource = "(.*)"', "{source}"),
    (r'\nIssues = "(.*)"', "{issues}"),
)
_IMAGE = (
    (r'image\.url="(.*?)"', "{home}"),
    (r'image\.source="(.*?)"', "{source}"),
    (r'image\.licenses="(.*?)"', "{licence}"),
    (r'image\.authors="(.*?)"', _PERSON),
)
# For each file expressions whose group is what the text beside them makes of the identity.
STATED = {
    "CITATION.cff": (
        (r"\n  - name: (The .*)", "{maintainer}"),
        (r"\nurl: (.*)", "{home}"),
        (r"\nrepository-code: (.*)", "{source}"),
        (r"\nlicense: (.*)", "{licence}"),
    ),
    "clients/conform/pyproject.toml": _PYPROJECT,
    "clients/java/README.md": ((r"`([\w.]+):stellate:\d", "{group}"),),
    "clients/java/pom.xml": (
        (r"\n  <groupId>(.*)</groupId>", "{group}"),
        (r"\n  <url>(.*)</url>", "{home}"),
        (r"<license>\s*<name>(.*)</name>", "{licence}"),
        (r"<developer>\s*<name>(.*)</name>", "{maintainer}"),
        (r"<email>(.*)</email>", "{email}"),
        (r"<scm>\s*<url>(.*)</url>", "{source}"),
        (r"<issueManagement>\s*<url>(.*)</url>", "{issues}"),
    ),
    "clients/node/package.json": (
        (r'\n  "license": "(.*)"', "{licence}"),
        (r'\n  "author": "(.*)"', _PERSON),
        (r'\n  "homepage": "(.*)"', "{home}"),
        (r'\n    "url": "(.*)"', "{source}"),
        (r'\n  "bugs": "(.*)"', "{issues}"),
    ),
    "clients/python/pyproject.toml": _PYPROJECT,
    "clients/r/DESCRIPTION": (
        (r"\nAuthor: (.*)", "{maintainer}"),
        (r"\nMaintainer: (.*)", _PERSON),
        (r"\nURL: (.*)", "{home}"),
        (r"\nBugReports: (.*)", "{issues}"),
    ),
    "clients/ruby/stellate.gemspec": (
        (r"gem\.authors = \['(.*)'\]", "{maintainer}"),
        (r"gem\.email = '(.*)'", "{email}"),
        (r"gem\.homepage = '(.*)'", "{home}"),
        (r"gem\.license = '(.*)'", "{licence}"),
        (r"\['source_code_uri'\] = '(.*)'", "{source}"),
        (r"\['bug_tracker_uri'\] = '(.*)'", "{issues}"),
    ),
    "clients/rust/Cargo.toml": (
        (r'\nlicense = "(.*)"', "{licence}"),
        (r'\nauthors = \["(.*)"\]', _PERSON),
        (r'\nhomepage = "(.*)"', "{home}"),
        (r'\nrepository = "(.*)"', "{source}"),
    ),
    "cmake/packages.cmake": ((r"CPACK_DEBIAN_PACKAGE_HOMEPAGE (.*)\)", "{home}"),),
    "docker/Dockerfile": _IMAGE,
    "docker/helm/stellate/Chart.yaml": (
        (r"\nhome: (.*)", "{home}"),
        (r"\nsources:\n  - (.*)", "{source}"),
        (r"\n  - name: (.*)", "{maintainer}"),
        (r"\n    email: (.*)", "{email}"),
    ),
}


def read() -> dict[str, str]:
    """What identity.toml says of who makes this."""
    return {name: said for name, said in _read().items() if isinstance(said, str)}


def registries() -> dict[str, str]:
    """Where each package is uploaded, by its name in packaging/publish."""
    return dict(_read()["registries"])


def _read() -> dict[str, Any]:
    return tomllib.loads((ROOT / "identity.toml").read_text())


def with_identity(path: str, text: str, identity: dict[str, str]) -> str:
    """A file's text with that identity. ValueError: it does not state what it should."""
    for expression, template in STATED[path]:
        matches = list(re.finditer(expression, text))
        if not matches:
            raise ValueError(f"{path}: nothing there is like {expression}")
        for match in reversed(matches):
            begin, end = match.span(1)
            text = text[:begin] + template.format(**identity) + text[end:]
    return text


def main() -> int:
    """The exit status."""
    if len(sys.argv) > 1:
        print(__doc__)
        return 0 if sys.argv[1:] in (["-h"], ["--help"]) else 2
    identity = read()
    for path in STATED:
        text = (ROOT / path).read_text()
        (ROOT / path).write_text(with_identity(path, text, identity))
    return 0


if __name__ == "__main__":
    sys.exit(main())
