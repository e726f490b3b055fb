"""Formulas of the pages, typeset: they are written as R^3, O(epsilon^2), R^(d-k), A_k^*, as a terminal shows
them, and need no TeX and no script.

What has an exponent, outside of code, gets it raised, and its letter in italics; epsilon and its like become
Greek. Names with underscores, as local_size, stay.
"""

import re

from docutils import nodes
from sphinx.transforms import SphinxTransform

_GREEK = {
    "epsilon": "\u03b5", "eps": "\u03b5", "delta": "\u03b4", "rho": "\u03c1", "theta": "\u03b8",
    "lambda": "\u03bb", "pi": "\u03c0",
}  # fmt: skip
_EXPONENT = r"\([^()\s]{1,12}\)|\{[^{}]{1,12}\}|-?\d+(?:/\d+)?|-?[A-Za-z](?![A-Za-z])|\*"
# A word, a number or what is in parentheses, perhaps an index, and the exponent. M^, with none, is a name.
_FORMULA = re.compile(
    rf"(?<![A-Za-z_^`$])(?P<base>{'|'.join(_GREEK)}|[A-Za-z]|\d+|(?<=\))(?=\^))"
    rf"(?:_(?P<low>\d|[a-z])(?![A-Za-z]))?\^(?P<high>{_EXPONENT})(?!\w)"
)


_TEX = re.compile(r"\$([^$`\s][^$`\n]{0,60})\$")  # as README has it, which forges typeset


def pieces(text: str) -> list[nodes.Node]:
    """The text as nodes, its formulas set; [] where there are none."""
    text = _TEX.sub(lambda match: match[1].replace("\\", ""), text)
    found, last = [], 0
    for match in _FORMULA.finditer(text):
        found.append(nodes.Text(text[last : match.start()]))
        last = match.end()
        base = match["base"]
        if base and not base.isdigit():
            found.append(nodes.emphasis("", _GREEK.get(base, base)))
        elif base:
            found.append(nodes.Text(base))
        if match["low"]:
            found.append(nodes.subscript("", match["low"]))
        high = match["high"].replace("-", "\u2212").replace("*", "\u2217")
        if high[0] in "({":
            high = high[1:-1]
        found.append(nodes.superscript("", high))
    return [*found, nodes.Text(text[last:])] if found else []


class Formulas(SphinxTransform):
    default_priority = 750  # once links are resolved

    def apply(self, **unused):
        if self.env.docname.startswith("reference"):
            return  # signatures and docstrings are as programs show them
        for text in list(self.document.findall(nodes.Text)):
            parents, parent = [], text.parent
            while parent is not None:
                parents.append(parent)
                parent = parent.parent
            if any(
                isinstance(p, (nodes.literal, nodes.literal_block, nodes.raw, nodes.comment))
                for p in parents
            ):
                continue
            if set_ := pieces(text.astext()):
                text.parent.replace(text, set_)


def setup(app):
    app.add_transform(Formulas)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
