"""Where a name of the package is: at its top what users need, in a module what fewer do."""

import importlib
import inspect
import pkgutil
import re
import types

import pytest
import stellate

PUBLIC = [
    importlib.import_module(f"stellate.{name}")
    for _, name, _ in pkgutil.iter_modules(stellate.__path__)
    if not name.startswith("_")
]
PAGES = ("README.md", "docs/**/*.md", "clients/python/**/*.md", "clients/python/**/*.py")
PROGRAMS = ("docker/*.py", "docs/**/*.py", "examples/**/*", "gallery/*.py")


def test_the_top_has_what_users_need_and_no_more():
    errors = set(stellate.errors.__all__)
    assert errors <= set(stellate.__all__)
    assert len(set(stellate.__all__) - errors) <= 27
    public = {name for name in vars(stellate) if not name.startswith("_")}
    modules = {module.__name__.partition(".")[2] for module in PUBLIC}
    assert public == set(stellate.__all__) | (modules & public)


@pytest.mark.parametrize("module", [stellate, *PUBLIC], ids=lambda module: module.__name__)
def test_what_a_module_offers_is_there_and_explained(module):
    if module.__name__ == "stellate.meshio_plugin":
        return  # which has nothing but what importing it does
    assert inspect.getdoc(module)
    for name in module.__all__:
        subject = getattr(module, name)
        if not isinstance(subject, str):
            assert inspect.getdoc(subject), f"{module.__name__}.{name}"


def test_equations_and_solids_are_found_the_same_way():
    for name in ("ImplicitManifold", "ImplicitSolid"):
        assert getattr(stellate, name) is getattr(stellate.oracles, name)


def leads_to_something(words):
    subject = stellate
    for name in words.split("."):
        if not isinstance(subject, (type, types.ModuleType)):
            return True
        if not hasattr(subject, name):
            # Attributes of instances, such as a dataclass's fields, are not looked for.
            return isinstance(subject, type)
        subject = getattr(subject, name)
    return True


def test_pages_and_programs_name_what_there_is(repository):
    missing = []
    spans = (repository / "server" / "session" / "mesh_spans.cc").read_text()
    attributes = set(re.findall(r'"stellate\.(\w+)"', spans))
    assert len(attributes) > 5
    for pattern in (*PAGES, *PROGRAMS):
        for file in repository.glob(pattern):
            if not file.is_file() or "_generated" in file.parts or file.suffix == ".png":
                continue
            for words in re.findall(
                r"(?<![\w/.\"-])stellate\.([a-zA-Z]\w*(?:\.\w+)*)", file.read_text()
            ):
                if words.startswith("v1.") or words in attributes:  # the protocol, and spans
                    continue
                if not leads_to_something(words):
                    missing.append(f"{file.relative_to(repository)}: stellate.{words}")
    assert missing == []
