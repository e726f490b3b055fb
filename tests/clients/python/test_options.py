"""The options of a mesh: what is said of them here, in the protocol, on command lines and in the pages."""

import inspect
import pydoc
import re
from typing import Literal, get_args, get_origin

import numpy as np
import pytest
import stellate
from google.protobuf.descriptor import FieldDescriptor
from stellate import _command_line, options
from stellate._generated import mesh_pb2
from stellate._wire.spec import mesh_spec
from stellate.oracle import CheckedOracle

ALL, OF_SPEC = options.types(options.MeshOptions), options.types(options.SpecOptions)
TAKERS = {
    stellate.mesh: ALL,
    stellate.watch: ALL,
    stellate.Client.create: OF_SPEC,
    stellate.pulling.pull: OF_SPEC,
}


@pytest.mark.parametrize("taker", TAKERS, ids=lambda f: f.__qualname__)
def test_signature_and_help_show_each_with_its_type(taker):
    shown = inspect.signature(taker).parameters
    assert not any(p.kind is p.VAR_KEYWORD for p in shown.values())
    of_help = pydoc.plain(pydoc.render_doc(taker))
    for name, kind in TAKERS[taker].items():
        assert (shown[name].annotation, shown[name].default) == (kind, None), name
        assert f"{name}: {inspect.formatannotation(kind)} = None" in of_help
    assert set(shown) - set(TAKERS[taker]) >= {"epsilon"}
    assert ("workers" in shown) == (TAKERS[taker] is ALL)


def test_the_documentation_of_mesh_says_what_each_is():
    words = " ".join(stellate.mesh.__doc__.split())
    for name, meaning in options.meanings(options.MeshOptions).items():
        assert f"{name}: {meaning}." in words
    assert "{options}" not in words


class Everything:
    """An oracle that can all that there is a field for."""

    dimension, ambient_dimension, walls = 2, 3, 3
    labels = [0, 1, 2, -1, -1, 1, 2, 0]
    closures = [(0, 1, 2)]
    region_names = ["core", "shell"]
    coordinate_scale = [1.0, 2.0, 3.0]
    bounding_box = [-1.0] * 3, [1.0] * 3
    seeds = np.ones((1, 3))

    def closest_point(self, x):
        return x

    intersect_flat = tangent_basis = local_size = face_point = clearances = conormals = (
        closest_point
    )


def some(kind):
    """A value of the type that an option has, which is no field's default."""
    kind = options.plain_type(kind)
    if get_origin(kind) is Literal:
        return get_args(kind)[-1]
    return {float: 0.5, int: 3, bool: True, str: "x"}.get(kind, [[1.0, 0.0, 0.0]])


def test_the_protocol_has_no_field_without_an_option():
    given = {name: some(kind) for name, kind in OF_SPEC.items() if name != "shape"}
    spec = mesh_spec(CheckedOracle(Everything()), 0.25, given)
    for message in (spec, spec.criteria, spec.limits):
        set_there = {field.name for field, _ in message.ListFields()}
        set_there |= {"reconstruction"} if message is spec else set()  # of stellate.reconstruct
        assert set_there == {field.name for field in message.DESCRIPTOR.fields}


@pytest.mark.parametrize("message", [mesh_pb2.Criteria, mesh_pb2.MeshLimits])
def test_types_are_those_of_the_protocol(message):
    kinds = {
        FieldDescriptor.CPPTYPE_DOUBLE: float,
        FieldDescriptor.CPPTYPE_UINT32: int,
        FieldDescriptor.CPPTYPE_UINT64: int,
        FieldDescriptor.CPPTYPE_BOOL: bool,
    }
    for field in message.DESCRIPTOR.fields:
        assert options.plain_type(OF_SPEC[field.name]) is kinds[field.cpp_type], field.name


def test_each_has_a_flag(monkeypatch):
    """But for seeds, which are the oracle's, and label, which `declare` alone asks for."""
    assert {*_command_line.FLAGS.values(), "seeds", "label"} == set(ALL)
    words, wanted = ["mesh", "shapes:torus", "-e", "0.1"], {}
    for flag, name in _command_line.FLAGS.items():
        wanted[name] = some(ALL[name])
        words += [flag] if wanted[name] is True else [flag, str(wanted[name])]
    parsed = _command_line._settings(_command_line._parser(False).parse_args(words))
    assert parsed == wanted
    assert {k: type(v) for k, v in parsed.items()} == {k: type(v) for k, v in wanted.items()}


def test_the_program_stellate_has_the_same_flags(repository):
    settings = (repository / "clients" / "cli" / "mesh_settings.cc").read_text()
    theirs = {*re.findall(r'^ +\{"(--[a-z-]+)', settings, re.M), "--audit", "--shape"}
    assert theirs - {"--reconnect"} == set(_command_line.FLAGS)


def test_the_page_of_criteria_names_each(repository):
    page = (repository / "docs" / "using" / "criteria.md").read_text()
    assert [name for name in ALL if f"`{name}`" not in page] == []


def test_none_is_the_same_as_not_given():
    oracle = CheckedOracle(Everything())
    assert mesh_spec(oracle, 0.25, dict.fromkeys(OF_SPEC)) == mesh_spec(oracle, 0.25, {})


class Solid(Everything):
    dimension = 3


class Closed:
    dimension, ambient_dimension = 3, 4
    seeds = np.ones((1, 4))

    def closest_point(self, x):
        return x


def test_good_shape_is_a_sliver_bound():
    oracle = CheckedOracle(Closed())
    spec = mesh_spec(oracle, 0.25, {"shape": "good", "sliver_bound": None})
    assert spec == mesh_spec(oracle, 0.25, {"sliver_bound": 0.3})


@pytest.mark.parametrize(
    "oracle, given, words",
    [
        (Closed, {"shape": "nice"}, "shape is 'nice' but must be 'good'"),
        (Closed, {"shape": "good", "sliver_bound": 0.2}, "give one of them"),
        (Solid, {"shape": "good"}, "closed manifolds, and this one has a boundary"),
        (Everything, {"shape": "good"}, "shape 'good' is for k = 3, and the manifold has k = 2"),
    ],
)
def test_good_shape_is_refused_where_it_says_nothing(oracle, given, words):
    with pytest.raises(stellate.InvalidArgument, match=words) as caught:
        mesh_spec(CheckedOracle(oracle()), 0.25, given)
    assert "shape" in caught.value.details["fields"]
