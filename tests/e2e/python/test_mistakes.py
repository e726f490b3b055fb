"""What newcomers get wrong is said in words, before anything is meshed."""

import numpy as np
import pytest
import stellate
from stellate import manifolds, solids


def mesh(oracle=None, epsilon=0.3, **keywords):
    return stellate.mesh(manifolds.Torus() if oracle is None else oracle, epsilon, **keywords)


def implicit(f=lambda x: (x * x).sum(axis=1, keepdims=True) - 1, **changed):
    given = {"ambient_dimension": 3, "dimension": 2, "bounding_box": ([-2] * 3, [2] * 3)}
    return stellate.ImplicitManifold(f, **{**given, **changed})


@pytest.mark.parametrize(
    "words, call",
    [
        ("a length .* or 'auto', and is '0.1'", lambda: mesh(epsilon="0.1")),
        ("a length .* or 'auto', and is True", lambda: mesh(epsilon=True)),
        (r"a length .* or 'auto', and is \[0.1\]", lambda: mesh(epsilon=[0.1])),
        (r"Torus is a class: .* Torus\(\)", lambda: mesh(manifolds.Torus)),
        ("str has no attribute dimension", lambda: mesh("torus")),
        ("'host:port' or 'unix:/path', and is 'here'", lambda: mesh(server="here")),
        ("'host:port' .* and is 'http://here:1'", lambda: mesh(server="http://here:1")),
        (r"such as stellate.progress_bar\(\), and is True", lambda: mesh(on_progress=True)),
        (r"such as .*, and is <function", lambda: mesh(on_progress=stellate.progress_bar)),
        ("workers has to be a whole number", lambda: mesh(workers="2")),
        ("max_vertices cannot be 'many'", lambda: mesh(max_vertices="many")),
        ("max_vertices cannot be 1.5", lambda: mesh(max_vertices=1.5)),
        ("is a file", lambda: mesh(checkpoint=__file__)),
        ("epsilon has to be a length, and is 'auto'", lambda: stellate.check(None, "auto")),
        ("f has to be a function, and is 3", lambda: implicit(3)),
        ("jacobian has to be a function, and is 3", lambda: implicit(jacobian=3)),
        ("whole numbers .* dimension '2'", lambda: implicit(dimension="2")),
        ("a pair of corners .* and is 5", lambda: implicit(bounding_box=5)),
    ],
)
def test_arguments(words, call):
    with pytest.raises(stellate.InvalidArgument, match=words):
        call()


def test_none_is_no_epsilon():
    with pytest.raises(TypeError, match='epsilon is missing: .* or epsilon="auto"'):
        mesh(epsilon=None)


@pytest.mark.parametrize(
    "words, f",
    [
        (r"shape \((\d+), 2\); .* \(\1, 1\) for a batch of \1", lambda x: x[:, :2]),
        (r"shape \(\); it has to be \((\d+), 1\) for a batch of \1", lambda p: (p * p).sum() - 1),
        ("f returned NoneType", lambda x: None),
        ("f returned list", lambda x: [["a"]] * len(x)),
    ],
)
def test_functions_that_return_something_else(words, f, server):
    with pytest.raises(stellate.OracleError, match=words):
        mesh(implicit(f), server=server)


def test_whole_numbers_may_be_written_as_floats(server):
    assert mesh(server=server, max_vertices=1e2).report.termination == "VERTEX_BUDGET"
    assert mesh(server=server, epsilon=np.float32(0.3)).certified


def test_a_file_that_is_no_mesh(tmp_path):
    (tmp_path / "binary.txt").write_bytes(bytes(range(256)))
    (tmp_path / "words.txt").write_text("1 2 1 1\n0.5 half 0 1\n")
    with pytest.raises(ValueError, match="binary.txt: the first line"):
        stellate.load_txt(tmp_path / "binary.txt")
    with pytest.raises(ValueError, match="words.txt: .*'half'"):
        stellate.load_txt(tmp_path / "words.txt")


def test_an_epsilon_for_too_many_vertices_is_said_before_it_takes_them(server):
    with pytest.warns(UserWarning, match="asks for about .* vertices.* at the 50 that") as caught:
        mesh(epsilon=0.01, max_vertices=50, server=server)
    assert caught[0].filename == __file__


def test_a_solid_without_an_end_is_no_mesh(server):
    outside = solids.Implicit(lambda x: (x * x).sum(axis=1) - 1, bounding_box=([-2] * 3, [2] * 3))
    with pytest.raises(stellate.OracleError, match="goes on outside of its bounding box"):
        mesh(outside, server=server, max_vertices=500)


def test_no_file_is_none_and_a_folder_is_no_file(server, tmp_path):
    assert mesh(server=server, save=None).certified
    with pytest.raises(IsADirectoryError, match="is a folder: give a file's name"):
        mesh(server=server, save=tmp_path)
