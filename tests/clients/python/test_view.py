"""Meshes in a browser: what the page is given, and what is said where there is no page."""

import base64
import json
import stat

import numpy as np
import pytest
import stellate
from shapes import torus
from stellate._generated import mesh_pb2, stellate_pb2

PAGE = '<!doctype html><script type="application/json" id="recording"></script><p>the rest</p>'


@pytest.fixture
def command(tmp_path, monkeypatch):
    """A `stellate` that says what it is told to."""

    def make(body):
        program = tmp_path / "stellate"
        program.write_text(f"#!/bin/sh\n{body}\n")
        program.chmod(program.stat().st_mode | stat.S_IXUSR)
        monkeypatch.setenv("STELLATE", str(program))

    return make


def recorded(page):
    before, _, after = page.partition('id="recording">')
    recording, _, rest = after.partition("</script>")
    assert before.startswith("<!doctype html>") and rest == "<p>the rest</p>"
    return {
        reply["method"]: [base64.b64decode(frame) for frame in reply["frames"]]
        for reply in json.loads(recording)["replies"]
    }


def test_the_page_is_given_the_mesh_as_a_server_would_send_it(tmp_path, command):
    command(f"printf '%s' '{PAGE}'")
    mesh = torus(5, 4)
    file = tmp_path / "torus.html"
    assert mesh.show(file, label="</script> forty faces") is None
    replies = recorded(file.read_text())
    grown, final = map(stellate_pb2.WatchMeshResponse.FromString, replies["WatchMesh"])
    delta = grown.delta.delta
    assert grown.delta.complete and list(delta.points.shape) == [20, 3]
    assert np.array_equal(np.frombuffer(delta.points.data).reshape(20, 3), mesh.points)
    assert np.array_equal(
        np.frombuffer(delta.added.data, "<u4").reshape(40, 3), np.sort(mesh.simplices, axis=1)
    )
    (status,) = map(mesh_pb2.Mesh.FromString, replies["GetMesh"])
    assert final.final == status
    assert status.spec.label == "</script> forty faces"
    assert (status.progress.vertices, status.progress.simplices) == (20, 40)
    assert not status.HasField("report")


def test_the_page_is_given_regions_and_what_became_of_points(tmp_path, command):
    command(f"printf '%s' '{PAGE}'")
    bare = torus(5, 4)
    labels = np.array([1, 2] * 20, dtype=np.int8)
    file = tmp_path / "mesh.html"

    def shown(**more):
        stellate.Mesh(bare.points, bare.simplices, **more).show(file)
        replies = recorded(file.read_text())
        grown = stellate_pb2.WatchMeshResponse.FromString(replies["WatchMesh"][0])
        return grown.delta.delta, mesh_pb2.Mesh.FromString(replies["GetMesh"][0]), replies

    delta, status, replies = shown(labels=labels)
    assert delta.added_labels == labels.tobytes() and status.spec.labels == b"\1\2"
    assert status.spec.dimension == 2 and not status.spec.boundary_only
    assert "DownloadMesh" not in replies

    delta, status, _ = shown(labels=np.stack([labels, 0 * labels], axis=1))
    assert delta.added_labels == b"\1\0\2\0" * 20 and status.spec.labels == b"\0\1\2"
    assert status.spec.dimension == 3 and status.spec.boundary_only

    delta, status, _ = shown(scale=(0.5, 4.0, 1.0))  # drawn divided by it, and read in x
    assert list(status.spec.scale) == [0.5, 4.0, 1.0]
    assert np.array_equal(np.frombuffer(delta.points.data).reshape(20, 3), bare.points)

    _, status, replies = shown(places=np.array(["OK"] * 17 + ["EDGE"] * 3))
    part = stellate_pb2.DownloadMeshResponse.FromString(replies["DownloadMesh"][0])
    assert part.places.codes == bytes(17) + b"\5\5\5"
    assert status.spec.HasField("reconstruction")
    assert [(p.place, p.points) for p in status.report.reconstruction.places] == [(0, 17), (5, 3)]


def test_no_command_line_is_an_error_of_its_own(monkeypatch):
    monkeypatch.setenv("STELLATE", "/nowhere/stellate")
    mesh = torus(5, 4)
    with pytest.raises(stellate.ViewerNotFound, match="clients/quickstart"):
        mesh.show("never.html")
    with pytest.raises(FileNotFoundError):
        stellate.viewer.LiveView("127.0.0.1:1")


def test_a_build_without_its_page_says_so(command):
    command("echo 'stellate: this build carries no viewer: npm was not found' >&2; exit 2")
    with pytest.raises(stellate.ViewerNotFound, match="^this build carries no viewer: npm"):
        torus(5, 4).show("never.html")


def test_a_live_view_is_told_where_and_whom_and_ends(tmp_path, command):
    command(
        f'echo "$@" >{tmp_path}/said; echo "$STELLATE_TOKEN" >>{tmp_path}/said\n'
        "echo http://127.0.0.1:4321/#key\ntrap 'exit 0' INT\nwhile :; do sleep 0.05; done"
    )
    credentials = stellate.Credentials(token="hush", ca="ca.pem")
    with stellate.viewer.LiveView("there:7717", "meshes/1", credentials=credentials) as view:
        assert view.url == "http://127.0.0.1:4321/#key"
        assert 'src="http://127.0.0.1:4321/#key"' in view._repr_html_()
        process = view._process
    assert process.poll() is not None
    said = (tmp_path / "said").read_text().splitlines()
    assert said[0] == "view meshes/1 --no-browser --server there:7717 --tls-ca ca.pem"
    assert said[1] == "hush", "a token is not for the list of processes"


def test_a_live_view_of_no_server_says_why(command):
    command("echo 'stellate: no answer from there:1' >&2; exit 3")
    with pytest.raises(stellate.Unavailable, match="^no answer from there:1$"):
        stellate.viewer.LiveView("there:1")
