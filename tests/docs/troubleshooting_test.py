"""docs/howto/troubleshooting.md knows every reason of the protocol and of the clients, and quotes what
the code says."""

from __future__ import annotations

import pathlib
import re
import sys

import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "howto" / "troubleshooting.md"
SOURCES = (
    "core/**/*.cc",
    "server/**/*.cc",
    "clients/cpp/**/*.cc",
    "clients/python/stellate/**/*.py",
)


def reasons() -> set[str]:
    """Of the protocol, of the table that all clients share, and the Python package's own."""
    proto = (ROOT / "proto/stellate/v1/errors.proto").read_text()
    found = set(re.findall(r"ERROR_REASON_([A-Z_]+) = ", proto))
    found |= set(tomllib.loads((ROOT / "clients/shared/errors.toml").read_text())["reasons"])
    errors = (ROOT / "clients/python/stellate/errors.py").read_text()
    found |= set(re.findall(r'default_reason = "([A-Z_]+)"', errors))
    return found - {"UNSPECIFIED", "CANCELLED"}


def said() -> str:
    """Every string literal of the programs, those that are written in pieces made whole."""
    parts = []
    for pattern in SOURCES:
        for path in sorted(ROOT.glob(pattern)):
            parts.append(re.sub(r'",?\s+f?"', "", path.read_text()))
    return "\n".join(parts).replace('\\"', '"')


def quotes(page: str) -> list[str]:
    return [" ".join(quote.split()) for quote in re.findall(r"(?m)^> (.*)$", page)]


def missing(page: str, known: set[str], literals: str) -> list[str]:
    described = set(re.findall(r"(?m)^### ([A-Z_]+)$", page))
    wrong = [f"no entry for {reason}" for reason in sorted(known - described)]
    own = {r for r in described - known if r not in literals}
    wrong += [f"nothing says {reason}" for reason in sorted(own)]
    for quote in quotes(page):
        pieces = [piece.strip(" :,;") for piece in quote.split("...")]
        lost = [piece for piece in pieces if len(piece) > 3 and piece not in literals]
        wrong += [f"no program says {piece!r}, of the message {quote!r}" for piece in lost]
    return wrong


def main() -> int:
    page, known, literals = PAGE.read_text(), reasons(), said()
    assert len(quotes(page)) > 20 and len(known) > 20
    wrong = missing(page, known, literals)
    # That it can fail at all.
    assert len(missing(page, known | {"BRAND_NEW"}, literals)) == len(wrong) + 1
    assert len(missing(page + "\n> this is never said by anyone\n", known, literals)) > len(wrong)
    print(
        "\n".join(wrong) or f"{len(known)} reasons, {len(quotes(page))} messages, all as they are"
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
