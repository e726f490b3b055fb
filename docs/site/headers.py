"""The public headers as a page: what Doxygen found in each, as Breathe's directives."""

from __future__ import annotations

import collections
import pathlib
import xml.etree.ElementTree as ET

_DIRECTIVES = {
    "class": "doxygenclass",
    "struct": "doxygenstruct",
    "enum": "doxygenenum",
    "typedef": "doxygentypedef",
    "variable": "doxygenvariable",
    "function": "doxygenfunction",
}


def page(folder: pathlib.Path) -> str:
    """Markdown."""
    found: dict[str, list[tuple[int, str]]] = collections.defaultdict(list)
    for compound in ET.parse(folder / "index.xml").getroot():
        described = ET.parse(folder / f"{compound.get('refid')}.xml").getroot()[0]
        if compound.get("kind") in ("class", "struct"):
            name = compound.findtext("name") or ""
            if not _is_inner(folder, described):
                _add(found, described, compound.get("kind") or "", name)
        elif compound.get("kind") == "namespace":
            members = described.findall("sectiondef/memberdef")
            names = collections.Counter(member.findtext("name") for member in members)
            for member in members:
                name = f"{compound.findtext('name')}::{member.findtext('name')}"
                if member.get("kind") == "function" and names[member.findtext("name")] > 1:
                    name += member.findtext("argsstring") or ""
                _add(found, member, member.get("kind") or "", name)
    parts = ["# C++\n", "The public headers: `stellate::client`, then `stellate::core`.\n"]
    for header in sorted(found, key=lambda name: (name.startswith("core"), name)):
        shown = f"stellate/{header}" if header.startswith("core") else header
        parts += [f"## {shown}\n", *(words for _, words in sorted(found[header]))]
    return "\n".join(parts)


def _is_inner(folder: pathlib.Path, described: ET.Element) -> bool:
    """A class within a class, which is shown there."""
    outer = (described.findtext("compoundname") or "").rpartition("::")[0]
    return any(
        (folder / f"{kind}{outer.replace('::', '_1_1')}.xml").exists() for kind in ("class", "struct")
    ) or any(
        inner.text == outer
        for inner in ET.parse(folder / "index.xml").findall("compound[@kind='struct']/name")
    )  # fmt: skip


def _add(
    found: dict[str, list[tuple[int, str]]], described: ET.Element, kind: str, name: str
) -> None:
    place = described.find("location")
    if place is None or kind not in _DIRECTIVES:
        return
    options = "\n:members:\n:undoc-members:" if kind in ("class", "struct") else ""
    header = (place.get("file") or "").removeprefix("clients/cpp/include/")
    text = f"```{{{_DIRECTIVES[kind]}}} {name}{options}\n```\n"
    found[header].append((int(place.get("line") or 0), text))
