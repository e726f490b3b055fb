"""Meshes in other programs' hands: meshio's plug-in, series for ParaView, tables in notebooks."""

import copy
import dataclasses
import html.parser
import importlib
import pickle
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import meshio
import numpy as np
import pytest
import shapes
import stellate
import stellate.meshio_plugin
import topology
from stellate._generated import mesh_pb2
from stellate._mesh import with_report


@pytest.mark.parametrize("mesh", [shapes.polygon(7, 5), shapes.torus(), shapes.simplex_boundary(3)])
def test_meshio_reads_and_writes_our_format_to_the_last_bit(mesh, tmp_path):
    mesh = stellate.Mesh(mesh.points * np.pi, mesh.simplices)
    mesh.save(tmp_path / "a.stellate.txt")
    read = meshio.read(tmp_path / "a.stellate.txt")
    assert read.points.shape == (len(mesh.points), 3)
    meshio.write(tmp_path / "b.stellate.txt", read)
    meshio.write(tmp_path / "c.other", read, file_format="stellate")
    text = (tmp_path / "a.stellate.txt").read_bytes()
    assert (tmp_path / "b.stellate.txt").read_bytes() == text
    assert (tmp_path / "c.other").read_bytes() == text


def test_meshio_converts_from_its_command_line(tmp_path, repository):
    mesh = shapes.torus()
    mesh.save(tmp_path / "torus.stellate.txt")
    subprocess.run(
        [sys.executable, "-m", "stellate.meshio_plugin", "convert",
         tmp_path / "torus.stellate.txt", tmp_path / "torus.vtu"],
        check=True, env={"PYTHONPATH": str(repository / "clients" / "python")}, capture_output=True,
    )  # fmt: skip
    read = meshio.read(tmp_path / "torus.vtu")
    assert np.array_equal(read.points, mesh.points)
    assert np.array_equal(np.sort(read.cells_dict["triangle"], axis=1), mesh.simplices)


def test_meshio_is_told_what_our_format_cannot_hold(tmp_path):
    squares = meshio.Mesh(np.eye(4, 3), [("quad", [[0, 1, 2, 3]])])
    with pytest.raises(meshio.WriteError, match="quad"):
        meshio.write(tmp_path / "a.stellate.txt", squares)
    (tmp_path / "no.stellate.txt").write_text("what is this")
    with pytest.raises(meshio.ReadError, match="first line"):
        stellate.meshio_plugin.read(tmp_path / "no.stellate.txt")
    shapes.simplex_boundary(4).save(tmp_path / "four.stellate.txt")
    with pytest.raises(meshio.ReadError, match="k = 4"):
        stellate.meshio_plugin.read(tmp_path / "four.stellate.txt")


def test_registering_twice_reads_once(tmp_path):
    importlib.reload(stellate.meshio_plugin)
    names = meshio._helpers.extension_to_filetypes[".stellate.txt"]
    assert names == ["stellate"]


def growing():
    torus = shapes.torus()
    for revision, share in enumerate((0, 3, 2, 1), 1):
        rows = torus.simplices[: len(torus.simplices) // share] if share else torus.simplices[:0]
        yield stellate.Mesh(torus.points, rows, revision=revision * 2)


@pytest.mark.parametrize("every, times", [(1, [4, 6, 8]), (2, [6, 8]), (9, [8])])
def test_a_series_has_every_step_and_ends_with_the_mesh(every, times, tmp_path):
    last = stellate.save_series(growing(), tmp_path / 'a "torus".pvd', every=every)
    assert len(last.simplices) == len(shapes.torus().simplices)
    sets = list(ElementTree.parse(tmp_path / 'a "torus".pvd').iter("DataSet"))
    assert [int(row.get("timestep")) for row in sets] == times
    steps = [meshio.read(tmp_path / row.get("file")) for row in sets]
    counts = [len(step.cells_dict["triangle"]) for step in steps]
    assert counts == sorted(counts) and counts[-1] == len(last.simplices)


def test_a_series_can_be_opened_while_it_grows(tmp_path):
    seen = []

    def watched():
        for mesh in growing():
            yield mesh
            if (tmp_path / "t.pvd").exists():
                seen.append(len(list(ElementTree.parse(tmp_path / "t.pvd").iter("DataSet"))))

    stellate.save_series(watched(), tmp_path / "t.pvd")
    assert seen == [1, 2, 3]


def test_a_series_of_nothing_or_elsewhere_is_refused(tmp_path):
    with pytest.raises(stellate.SaveError, match="pvd"):
        stellate.save_series(growing(), tmp_path / "t.vtu")
    with pytest.raises(stellate.InvalidArgument, match="no mesh"):
        stellate.save_series([], tmp_path / "t.pvd")
    with pytest.raises(FileNotFoundError):
        stellate.save_series(growing(), tmp_path / "nowhere" / "t.pvd")
    with pytest.raises(stellate.InvalidArgument, match="every"):
        stellate.save_series(growing(), tmp_path / "t.pvd", every=0)


class Balanced(html.parser.HTMLParser):
    """All text of a page whose tags close."""

    def __init__(self):
        super().__init__()
        self.open, self.text = [], ""

    def handle_starttag(self, tag, attrs):
        assert tag in ("table", "caption", "tr", "th", "td")
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def shown(thing):
    page = thing._repr_html_()
    assert len(page) < 20_000
    parser = Balanced()
    parser.feed(page)
    assert not parser.open
    return parser.text


def test_a_mesh_in_a_notebook():
    text = shown(shapes.torus())
    assert "2 in R^3" in text and f"{len(shapes.torus().simplices):,} simplices" in text
    assert "none" in text


def test_strange_words_are_escaped(hostile="<script>alert('x')</script> & \"more\""):
    finding = stellate.Finding("error", "NOT_CLOSEST", hostile, "", {})
    report = stellate.CheckReport((finding,), 5, 60, None, None, {}, None)
    assert hostile in shown(report)
    assert "<script" not in report._repr_html_()
    assert report.summary in shown(report) and report.summary in str(report)


@pytest.mark.parametrize(
    "convert", ["to_meshio", "to_pyvista", "to_trimesh", "to_open3d", "to_pandas"]
)
def test_a_library_that_is_not_there_is_named(convert, monkeypatch):
    name = convert[3:]
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ImportError, match=f"no {name} here.*install"):
        getattr(shapes.torus(), convert)()


def test_a_frame_has_the_names_of_coordinates():
    pytest.importorskip("pandas")
    torus = shapes.torus()
    frame = torus.to_pandas()
    assert list(frame) == ["x", "y", "z"] and frame.index.name == "vertex"
    assert np.array_equal(frame.to_numpy(), torus.points)
    frame.loc[0, "x"] = 7.0  # a copy
    assert torus.points[0, 0] != 7
    assert list(shapes.polygon(5, 4).to_pandas()) == ["x0", "x1", "x2", "x3"]
    named = dataclasses.replace(torus, coordinate_names=("strain", "kelvin", "stress"))
    assert list(named.to_pandas()) == ["strain", "kelvin", "stress"]
    assert list(named.to_pandas(names=["a", "b", "c"])) == ["a", "b", "c"]
    for wrong in (["a", "b"], "abc"):
        with pytest.raises(stellate.InvalidArgument, match="names have to be 3"):
            torus.to_pandas(wrong)


def test_a_report_leaves_all_else_of_a_mesh_as_it_is():
    values = {field.name: object() for field in dataclasses.fields(stellate.Mesh)}
    finished = with_report(stellate.Mesh(**values), report := object())
    assert isinstance(finished, stellate.FinishedMesh)
    given = {field.name: getattr(finished, field.name) for field in dataclasses.fields(finished)}
    assert given == {**values, "report": report}


def test_meshio_meshes_have_all_coordinates():
    plane = shapes.projective_plane()
    converted = plane.to_meshio()
    assert np.array_equal(converted.point_data["coordinates"], plane.points)
    assert topology.is_closed(converted.cells_dict["triangle"])
    with pytest.raises(stellate.InvalidArgument, match="k = 4"):
        shapes.simplex_boundary(4).to_meshio()


@pytest.mark.parametrize("certified", [False, True])
def test_a_report_in_a_notebook_says_what_print_says(certified):
    certificate = mesh_pb2.Certificate(certified=certified, verdict="certified: all <b>fine</b>")
    said = "          run  cancelled\n  certificate  all\n               <b>fine</b>\n"
    message = mesh_pb2.Report(certificate=certificate, text=said)
    report = stellate.Report.from_wire(message, 0.25)
    text = shown(report)
    assert "all\n<b>fine</b>" in text and len(report.lines()) == 2
    for title, words in report.lines():
        assert title in text and words in text
    assert "<b>fine</b>" in shown(stellate.Mesh(np.eye(3), np.array([[0, 1]]), report))


def test_what_others_call_the_parts_of_a_mesh_is_told():
    mesh = shapes.torus()
    for name, here in {
        "vertices": "`points`",
        "triangles": "`simplices`",
        "export": "save",
    }.items():
        with pytest.raises(AttributeError, match=f"no attribute '{name}': here it is .*{here}"):
            getattr(mesh, name)
    with pytest.raises(AttributeError, match="no attribute 'colour'$"):
        mesh.colour  # noqa: B018
    again = copy.deepcopy(pickle.loads(pickle.dumps(mesh)))
    assert np.array_equal(again.points, mesh.points) and not hasattr(mesh, "vertices")


def test_what_a_solid_has_in_place_of_what_surfaces_have_is_told():
    solid = stellate.Mesh(np.eye(4)[:, :3], np.array([[0, 1, 2, 3]]))
    with pytest.raises(stellate.InvalidArgument, match="a `volume` of its own"):
        solid.enclosed_volume  # noqa: B018
    with pytest.raises(stellate.InvalidArgument, match=r"its boundary_mesh\(\) has some"):
        solid.normals()
    with pytest.raises(ValueError, match="all one, without regions, and has no region 1"):
        solid.region(1)
