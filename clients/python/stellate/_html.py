"""Tables for notebooks: small, without scripts, all text escaped."""

from __future__ import annotations

import html
from collections.abc import Iterable

_MARKS = {"good": "#1a7f37", "bad": "#c62828", "mind": "#9a6700", "": "inherit"}
_CELL = "text-align:left;vertical-align:top;white-space:pre-wrap"


def table(title: str, rows: Iterable[tuple[str, str, str]]) -> str:
    """A titled table of (name, text, mark); a mark is "good", "bad", "mind" or ""."""
    lines = [f"<table><caption>{html.escape(title)}</caption>"]
    for name, text, mark in rows:
        lines.append(
            f'<tr><th style="{_CELL}">{html.escape(name)}</th>'
            f'<td style="{_CELL};color:{_MARKS[mark]}">{html.escape(text)}</td></tr>'
        )
    return "\n".join([*lines, "</table>"])
