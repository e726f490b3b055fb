"""How Sphinx builds the pages of the repository, and what is generated beside them, into a site.

`docs/build` lays out what this reads: a folder of links to the repository's, with `reference/` beside
them, which reference.py writes. All of it works without a network.
"""

import os
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "clients" / "python"), str(ROOT / "docs" / "site")]

project = "Stellate"
release = (ROOT / "VERSION").read_text().strip()
root_doc = "docs/index"
include_patterns = [
    "README.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md", "MAINTAINERS.md",
    "docs/**.md", "gallery/**.md",
    "clients/*/README.md", "proto/README.md", "tests/conformance/README.md", "reference/**",
]  # fmt: skip
exclude_patterns = [
    "build", "core", "server", "docker", "packaging", "text", "tools", "cmake", "**/node_modules",
    "**/target", "**/_generated", "**/dist",
]  # fmt: skip

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "breathe", "formulas"]
myst_heading_anchors = 4
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}

breathe_projects = {"stellate": ""}  # docs/build says where
breathe_default_project = "stellate"
breathe_default_members = ("members", "undoc-members")
primary_domain = "cpp"
highlight_language = "none"

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "undoc-members": True}
nitpicky = False

smartquotes = False  # they take -- of --flags for a dash
html_theme = "furo"
html_title = f"Stellate {release}"
html_copy_source = False
html_static_path = [str(ROOT / "docs" / "site" / "static")]
html_css_files = ["site.css"]
html_js_files = ["copy.js"]
html_extra_path = [str(ROOT / "docs" / "site" / "top")]
html_theme_options = {"navigation_with_keys": True}

# What Pygments cannot place is shown as it is.
suppress_warnings = ["misc.highlighting_failure"]
napoleon_use_ivar = True
# Ours are sentences, of which Napoleon would take each line for the name of a class.
napoleon_custom_sections = ["Raises"]


_LINK = re.compile(r"(?<!!)\[([^\]\n]*(?:\n[^\]\n]*)?)\]\(([^)\s]+)\)")


def _folders_are_no_pages(app, page, source):
    """A link to a folder leads to its README, where that is a page; else it is its words."""
    here = pathlib.Path(app.env.doc2path(page)).parent

    def resolve(match):
        words, target = match.groups()
        path, _, anchor = target.partition("#")
        there = here / path
        if re.match(r"[a-z]+:", target) or not path or not there.is_dir():
            return match[0]
        readme = (there / "README").resolve().relative_to(ROOT)
        if str(readme) in app.env.found_docs:
            return f"[{words}]({path.rstrip('/')}/README.md)"
        return words

    source[0] = _LINK.sub(resolve, source[0])


def _lists_are_contents(app, page, source):
    """The pages that an index.md links to are the contents of the site, by its headings.

    So the lists of pages are written once, as forges show them. A page that is in none of them is a
    warning of Sphinx's.
    """
    if not page.endswith("/index") or page.startswith("reference"):
        return
    here = pathlib.PurePosixPath(page).parent
    seen = (
        {page}
        if page == root_doc
        else {page, *_linked("docs", (ROOT / "docs/index.md").read_text())}
    )
    contents = []
    for part in re.split(r"(?m)^## ", source[0]):
        found = []
        for linked in _linked(here, part):
            inside = page == root_doc or linked.startswith(f"{here}/")
            if inside and linked in app.env.found_docs and linked not in seen:
                seen.add(linked)
                found.append(linked)
        if page == root_doc and part.startswith("Reference"):
            found.append("reference/index")
        if found:
            heading = part.partition("\n")[0]
            caption = heading if page == root_doc and not heading.startswith("#") else ""
            contents.append(_toctree(caption, found))
    source[0] += "\n\n" + "\n".join(contents)


def _linked(here, text):
    """The names of the pages that the text of a page in the folder `here` links to."""
    targets = [target.partition("#")[0] for _, target in _LINK.findall(text)]
    return [os.path.normpath(f"{here}/{target.removesuffix('.md')}") for target in targets]


def _toctree(caption, pages):
    listed = "\n".join(f"/{page}" for page in pages)
    named = f":caption: {caption}\n" if caption else ""
    return f"```{{toctree}}\n:hidden:\n{named}\n{listed}\n```\n"


_SECTION = re.compile(r"(Args|Keyword Args|Attributes|Raises|Returns|Warns|Yields):( .*)?$")


def _plain_words(app, what, name, subject, options, lines):
    """Our docstrings are plain text: stars are stars, what is set in by four is shown as it stands.

    Napoleon knows sections whose heading stands alone; of others ("Raises: OSError") the words go on
    below, set in a little.
    """
    out, quoted, section = [], False, None
    for line in lines:
        heading = _SECTION.match(line)
        if heading or line and not line.startswith(" "):
            section = heading
        deep = line.startswith("    ") and not section
        if deep != quoted and (deep or line.strip()):
            out += ["", "::", ""] if deep else [""]
            quoted = deep
        if heading and heading[2]:
            out += ["", f"{heading[1]}:{heading[2]}"]
        elif section and section[2]:
            out.append(line.strip())
        else:
            out.append(line)
        if not deep:
            out[-1] = out[-1].replace("*", r"\*")
    lines[:] = out


def _styles_stand_alone(app, error):
    """Debian's Furo imports normalize.css from where its web servers have it: it goes along."""
    style = pathlib.Path(app.outdir) / "_static" / "styles" / "furo.css"
    absolute = "/javascript/normalize.css/normalize.css"
    if error is not None or not style.exists() or absolute not in style.read_text():
        return
    kept = pathlib.Path("/usr/share/nodejs/normalize.css/normalize.css").read_text()
    (style.parent / "normalize.css").write_text(kept)
    style.write_text(style.read_text().replace(absolute, "normalize.css"))


def setup(app):
    app.connect("build-finished", _styles_stand_alone)
    app.connect("source-read", _lists_are_contents)
    app.connect("source-read", _folders_are_no_pages)
    app.connect("autodoc-process-docstring", _plain_words, priority=100)
