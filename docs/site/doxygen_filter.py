"""A header as Doxygen reads it: our comments are plain `//`, and speak of what follows them, or, at the
end of a line, of what precedes them. Usage: doxygen_filter.py HEADER"""

import re
import sys


def filtered(text: str) -> str:
    out = []
    column = -1  # of the comment at the end of the line before, which whole lines go on with
    for line in text.splitlines():
        whole = re.match(r"^(\s*)//(?!/)\s?(.*)$", line)
        end = re.match(r"^(\s*[^\s#/].*?\s+)//(?!/)\s?(.*)$", line)
        if whole and len(whole[1]) == column:
            out.append(f"{whole[1]}///< {_plain(whole[2])}")
            continue
        if whole:
            out.append(f"{whole[1]}/// {_plain(whole[2])}")
        elif end:
            out.append(f"{end[1]}///< {_plain(end[2])}")
        else:
            out.append(line)
        column = len(end[1]) if end and not whole else -1
    return "\n".join(out) + "\n"


def _plain(words: str) -> str:
    """Words, not Doxygen's commands."""
    words = re.sub(r"^   +(?=\S)", "", words)
    return re.sub(r"([\\<>&#]|(?<!\S)@)", r"\\\1", words)


if __name__ == "__main__":
    with open(sys.argv[1], encoding="utf-8") as header:
        sys.stdout.write(filtered(header.read()))
