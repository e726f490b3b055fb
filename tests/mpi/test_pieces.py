"""The pieces that ranks write for ParaView are together the mesh that one process makes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from jobs import job, mesh, oracle, ranks, refused, run

MANIFOLDS = {
    "torus": ["torus:1:0.4", "-e", ".1"],
    "curve": ["torus-knot:2:3", "-e", ".1"],
    "clifford": ["clifford-torus", "-e", ".2"],
    "sphere3": ["sphere:3", "-e", ".4"],
    "solid": ["--solid", "box(-1,1) - cylinder(x, .5)", "-e", ".35"],
    "materials": ["--material", "a=ball(1)", "--material", "b=ball(.5)", "-e", ".3"],
    "boundary": ["--solid", "ball(1) - ball(.5, at=(1,0,0))", "-e", ".3", "--boundary-only"],
    "not_certified": ["torus:1:0.4", "-e", ".05", "--max-vertices", "500"],
}
IDS = "GlobalPointIds"


def cells_of(
    file: meshio.Mesh, ids: np.ndarray[Any, Any]
) -> dict[tuple[int, ...], tuple[float, ...]]:
    """What is said of each cell, by the mesh's ids of its vertices in their order."""
    names = sorted(file.cell_data)
    cells = {}
    for number, block in enumerate(file.cells):
        for row, ids_of_cell in enumerate(ids[block.data].tolist()):
            said = [np.ravel(file.cell_data[name][number][row]).tolist() for name in names]
            assert tuple(ids_of_cell) not in cells
            cells[tuple(ids_of_cell)] = tuple(sum(said, []))
    return cells


def joined(
    folder: Path, count: int, alone: meshio.Mesh
) -> dict[tuple[int, ...], tuple[float, ...]]:
    """The cells of all pieces, once their points are seen to be those of the whole."""
    cells: dict[tuple[int, ...], tuple[float, ...]] = {}
    seen = np.zeros(len(alone.points), bool)
    most = 0
    for rank in range(count):
        piece = meshio.read(folder / f"{folder.name}_{rank}.vtu")
        ids = piece.point_data.pop(IDS).ravel()
        assert np.array_equal(ids, np.unique(ids))
        assert np.array_equal(piece.points, alone.points[ids])
        assert set(piece.point_data) == set(alone.point_data)
        for name, data in piece.point_data.items():
            assert np.array_equal(data, alone.point_data[name][ids]), name
        assert set(piece.cell_data) == set(alone.cell_data)
        assert set(piece.field_data) == set(alone.field_data)
        for name, data in piece.field_data.items():
            assert np.array_equal(data, alone.field_data[name]), name
        own = cells_of(piece, ids)
        assert not own.keys() & cells.keys()
        cells.update(own)
        seen[ids] = True
        most = max(most, len(own))
    assert seen.all()
    # By vertices, of which a box has as many as others.
    assert most <= 1.5 * len(cells) / count
    return cells


@pytest.mark.parametrize("name", MANIFOLDS)
def test_joined_by_their_ids_they_are_the_mesh(name: str, tmp_path: Path) -> None:
    asked = MANIFOLDS[name]
    one = mesh(*asked, "-o", tmp_path / "alone.vtu")
    assert one.returncode == (1 if name == "not_certified" else 0), one.stderr
    alone = meshio.read(tmp_path / "alone.vtu")
    expected = cells_of(alone, np.arange(len(alone.points)))
    for count in (1, 2, 4):
        done = job(count, *asked, "-o", tmp_path / f"in_{count}.pvtu")
        assert done.returncode == one.returncode, done.stderr
        folder = tmp_path / f"in_{count}"
        assert sorted(folder.iterdir()) == [folder / f"in_{count}_{i}.vtu" for i in range(count)]
        assert joined(folder, count, alone) == expected


@pytest.mark.parametrize("name", ["torus", "clifford", "materials"])
def test_paraviews_reader_has_the_same(name: str, tmp_path: Path) -> None:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLPUnstructuredGridReader, vtkXMLUnstructuredGridReader

    def read(reader: Any, file: Path) -> Any:
        assert reader.CanReadFile(str(file))
        reader.SetFileName(str(file))
        reader.Update()
        assert reader.GetErrorCode() == 0
        return reader.GetOutput()

    file = tmp_path / 'a & "b".pvtu'
    done = job(3, *MANIFOLDS[name], "-o", tmp_path / "alone.vtu", "-o", file)
    assert done.returncode == 0, done.stderr
    alone = read(vtkXMLUnstructuredGridReader(), tmp_path / "alone.vtu")
    pieces = read(vtkXMLPUnstructuredGridReader(), file)
    assert pieces.GetPointData().GetGlobalIds().GetName() == IDS
    ids = vtk_to_numpy(pieces.GetPointData().GetGlobalIds())
    points = vtk_to_numpy(alone.GetPoints().GetData())
    assert np.array_equal(vtk_to_numpy(pieces.GetPoints().GetData()), points[ids])
    assert len(np.unique(ids)) == len(points)

    def cells(grid: Any, names: Any) -> list[tuple[Any, ...]]:
        data = grid.GetCellData()
        said = [
            vtk_to_numpy(data.GetArray(i)).reshape(grid.GetNumberOfCells(), -1)
            for i in range(data.GetNumberOfArrays())
        ]
        every = []
        for j in range(grid.GetNumberOfCells()):
            cell = grid.GetCell(j).GetPointIds()
            every.append(
                (
                    tuple(int(names[cell.GetId(i)]) for i in range(cell.GetNumberOfIds())),
                    *(tuple(array[j].tolist()) for array in said),
                )
            )
        return sorted(every)

    assert cells(pieces, ids) == cells(alone, np.arange(len(points)))


def test_fewer_points_than_ranks(tmp_path: Path) -> None:
    done = job(4, "sphere:1", "-e", ".5", "-o", tmp_path / "tiny.pvtu", "--max-vertices", "3")
    assert done.returncode in (0, 1), done.stderr
    assert len(list((tmp_path / "tiny").iterdir())) == 4


def test_a_run_with_fewer_ranks_replaces_all(tmp_path: Path) -> None:
    file = tmp_path / "torus.pvtu"
    (tmp_path / "torus").mkdir()
    (tmp_path / "torus" / "notes.txt").write_text("mine")
    for count, epsilon in ((4, ".2"), (2, ".1")):
        assert job(count, "torus:1:0.4", "-e", epsilon, "-o", file).returncode == 0
        names = {f"torus_{i}.vtu" for i in range(count)}
        assert {path.name for path in (tmp_path / "torus").iterdir()} == names | {"notes.txt"}
        assert file.read_text().count("<Piece ") == count


def test_an_index_behind_a_link(tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    (tmp_path / "far" / "it.pvtu").write_text("an older one")
    (tmp_path / "near.pvtu").symlink_to(tmp_path / "far" / "it.pvtu")
    assert job(2, "torus:1:0.4", "-e", ".2", "-o", tmp_path / "near.pvtu").returncode == 0
    assert (tmp_path / "near.pvtu").is_symlink()
    assert "it/it_1.vtu" in (tmp_path / "near.pvtu").read_text()
    assert (tmp_path / "far" / "it" / "it_1.vtu").exists()


def test_a_folder_that_one_rank_does_not_have(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    (tmp_path / "a" / "out").mkdir()
    words = ranks(1, "torus:1:0.4", "-e", ".2", "-o", "out/torus.pvtu")
    jobs = ["mpirun", "-wdir", tmp_path / "a", *words, ":", "-wdir", tmp_path / "b", *words]
    refused(run(jobs), 2, "rank 1: ", "out/torus.pvtu", "No such file")
    assert list((tmp_path / "a" / "out").iterdir()) == []


def test_a_dimension_that_vtk_has_no_cells_for(tmp_path: Path) -> None:
    refused(job(2, "sphere:4", "-e", ".9", "-o", tmp_path / "s.pvtu"), 2, ".pvtu", "dimension 3")


def test_a_piece_that_cannot_take_its_place(tmp_path: Path) -> None:
    # Once all have been asked whether they can write.
    blocked = tmp_path / "torus" / "torus_1.vtu"
    command = oracle(tmp_path, 2000, f"system qw(mkdir -p), q({blocked}); $bytes = -1e9")
    file = tmp_path / "torus.pvtu"
    done = job(3, "--oracle-command", command, "-e", ".1", "-o", file)
    refused(done, 2, "rank 1: ", "torus_1.vtu")
    assert {path.name for path in tmp_path.iterdir()} == {"oracle", "torus"}
    assert list((tmp_path / "torus").iterdir()) == [blocked]


def test_a_rank_that_dies_leaves_no_piece(tmp_path: Path) -> None:
    command = oracle(tmp_path, 20000, "kill KILL => $ENV{RANK}; exit")
    done = job(3, "--oracle-command", command, "-e", ".05", "-o", tmp_path / "torus.pvtu")
    assert done.returncode not in (0, 1, 2, 3), done.stderr
    assert list(tmp_path.iterdir()) == [tmp_path / "oracle"]


def test_one_process_says_who_writes_them(tmp_path: Path) -> None:
    refused(mesh("torus", "-e", ".2", "-o", tmp_path / "t.pvtu"), 2, ".pvtu", "stellate-mpi")
