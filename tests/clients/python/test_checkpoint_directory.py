"""A checkpoint's directory in which somebody else could have put something: nothing there is believed,
and no link leads to a file that is overwritten."""

import os

import numpy as np
import pytest
import stellate
from stellate._checkpoint import Checkpoint
from stellate._generated import mesh_pb2 as pb

SPEC = pb.MeshSpec(dimension=1, ambient_dimension=2, epsilon=0.5)
REPORT = stellate.Report.from_wire(pb.Report(certificate=pb.Certificate(certified=True)), 0.5)
MESH = stellate.FinishedMesh(np.eye(3, 2), np.array([[0, 1], [1, 2], [0, 2]], np.uint32), REPORT)


def kept(directory, spec=SPEC):
    with Checkpoint(directory) as checkpoint:
        checkpoint.require(spec)
        return checkpoint.finished(spec)


def keep(directory, spec=SPEC):
    with Checkpoint(directory) as checkpoint:
        checkpoint.note(spec, "meshes/1", "", 0)
        checkpoint.keep(MESH)


def refused(directory, match):
    with pytest.raises(stellate.InvalidArgument, match=match):
        kept(directory)


def test_what_was_kept_is_there(tmp_path):
    keep(tmp_path / "c")
    assert np.array_equal(kept(tmp_path / "c").points, MESH.points)
    assert os.stat(tmp_path / "c").st_mode & 0o777 == 0o700


def test_a_part_of_a_manifold_is_not_taken_for_the_whole(tmp_path):
    with Checkpoint(tmp_path / "c", "seeds") as checkpoint:
        checkpoint.note(SPEC, "meshes/1", "", 0)
        checkpoint.keep(MESH)
    refused(tmp_path / "c", "keep is seeds there and not given here")
    with Checkpoint(tmp_path / "c", "seeds") as checkpoint:
        checkpoint.require(SPEC)
    keep(tmp_path / "whole")
    with Checkpoint(tmp_path / "whole", "seeds") as checkpoint:
        with pytest.raises(stellate.InvalidArgument, match="keep is not given there and seeds"):
            checkpoint.require(SPEC)


def test_a_link_to_a_directory_is_refused(tmp_path):
    (tmp_path / "theirs").mkdir(mode=0o700)
    (tmp_path / "c").symlink_to(tmp_path / "theirs")
    refused(tmp_path / "c", "is a link")
    refused(f"{tmp_path}/c/", "is a link")
    assert not list((tmp_path / "theirs").iterdir())


@pytest.mark.parametrize("mode", [0o777, 0o720, 0o702])
def test_a_directory_that_others_write_in_is_refused(mode, tmp_path):
    (tmp_path / "c").mkdir()
    (tmp_path / "c").chmod(mode)
    refused(tmp_path / "c", "written by others.*chmod go-w")


def test_a_directory_of_somebody_else_is_refused(tmp_path, monkeypatch):
    (tmp_path / "c").mkdir(mode=0o700)
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    refused(tmp_path / "c", "belongs to another user")
    assert not list((tmp_path / "c").iterdir())


@pytest.mark.parametrize("name", ["lock", "mesh.json", "mesh.npz"])
def test_a_link_within_is_refused(name, tmp_path):
    keep(tmp_path / "other")
    keep(tmp_path / "c")
    planted = tmp_path / "c" / name
    planted.unlink()
    planted.symlink_to(tmp_path / "other" / name)
    before = (tmp_path / "other" / name).read_bytes()
    refused(tmp_path / "c", f"{name} is a link")
    assert (tmp_path / "other" / name).read_bytes() == before


def test_a_pipe_within_is_not_waited_for(tmp_path):
    keep(tmp_path / "c")
    (tmp_path / "c" / "mesh.json").unlink()
    os.mkfifo(tmp_path / "c" / "mesh.json")
    refused(tmp_path / "c", "no file of this user's")


@pytest.mark.parametrize("name", ["mesh.json.new", "mesh.npz.new"])
@pytest.mark.parametrize("link", ["symlink_to", "hardlink_to"])
def test_drafts_overwrite_nothing(name, link, tmp_path):
    precious = tmp_path / "precious"
    precious.write_text("mine")
    (tmp_path / "c").mkdir(mode=0o700)
    draft = tmp_path / "c" / name
    draft.symlink_to(precious) if link == "symlink_to" else os.link(precious, draft)
    keep(tmp_path / "c")
    assert precious.read_text() == "mine"
    assert not draft.exists() and kept(tmp_path / "c") is not None


def test_a_result_of_another_specification_is_refused(tmp_path):
    keep(tmp_path / "planted", pb.MeshSpec(dimension=1, ambient_dimension=2, epsilon=0.25))
    with Checkpoint(tmp_path / "c") as checkpoint:
        checkpoint.note(SPEC, "meshes/1", "", 0)
    os.replace(tmp_path / "planted" / "mesh.npz", tmp_path / "c" / "mesh.npz")
    refused(tmp_path / "c", "mesh.npz is no mesh that was kept .*another specification.*remove")
