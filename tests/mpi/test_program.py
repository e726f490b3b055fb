"""A program of C++ gets in all of its ranks what one process makes, or learns in all why not."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from jobs import mesh, run


def said(count: int, what: str, folder: Path, *manifold: str) -> list[str]:
    """What each rank says, by rank."""
    done = run(["mpirun", "-n", str(count), os.environ["MPI_PROGRAM"], what, folder, *manifold])
    assert done.returncode == 0, done.stderr
    lines = sorted(line for line in done.stdout.splitlines() if line.startswith("rank "))
    assert [line[: len("rank 0")] for line in lines] == [f"rank {rank}" for rank in range(count)]
    return [line.partition(": ")[2] for line in lines]


@pytest.mark.parametrize(
    ("what", "manifold", "asked"),
    [
        ("mesh", "torus:1:0.4", ["torus:1:0.4"]),
        ("mesh", "sphere:3", ["sphere:3"]),
        ("mesh", "ball(1) - cylinder(x, .5)", ["--solid", "ball(1) - cylinder(x, .5)"]),
        (
            "scaled",
            "ball(1).at(.5, 0, 0)",
            ["--solid", "ball(1).at(.5, 0, 0)", "--scale", "1,1,.5"],
        ),
    ],
)
def test_every_rank_has_the_mesh_of_one_process(
    what: str, manifold: str, asked: list[str], tmp_path: Path
) -> None:
    alone = mesh(*asked, "-e", ".2", "-o", tmp_path / "alone.vtu")
    assert alone.returncode == 0, alone.stderr
    for count in (1, 3):
        verdicts = said(count, what, tmp_path, manifold)
        assert set(verdicts) == {verdicts[0]} and verdicts[0].endswith("vertices, certified")
        for rank in range(count):
            assert (tmp_path / f"{rank}.vtu").read_bytes() == (tmp_path / "alone.vtu").read_bytes()


def test_files_come_from_the_first_rank(tmp_path: Path) -> None:
    assert mesh("torus:1:0.4", "-e", ".2", "-o", tmp_path / "alone.vtu").returncode == 0
    verdicts = said(3, "files", tmp_path, "torus:1:0.4")
    assert set(verdicts) == {verdicts[0]} and verdicts[0].endswith("vertices, certified")
    assert (tmp_path / "to.vtu").read_bytes() == (tmp_path / "alone.vtu").read_bytes()


def test_an_oracle_of_one_s_own(tmp_path: Path) -> None:
    verdicts = said(2, "mesh", tmp_path)
    assert set(verdicts) == {verdicts[0]} and verdicts[0].endswith("vertices, certified")


def test_one_rank_that_asks_for_the_end_stops_all(tmp_path: Path) -> None:
    verdicts = said(3, "stop", tmp_path)
    assert set(verdicts) == {verdicts[0]} and verdicts[0].endswith("vertices, not certified")


def test_an_exception_of_on_progress_is_its_caller_s_and_stops_all(tmp_path: Path) -> None:
    first, thrown, third = said(3, "progress", tmp_path)
    assert thrown == "thrown: seen enough"
    assert first == third and first.endswith("vertices, not certified")


def test_an_oracle_that_throws_is_named_in_all_ranks(tmp_path: Path) -> None:
    errors = said(3, "oracle", tmp_path)
    assert set(errors) == {errors[0]} and "the sphere is lost" in errors[0]
    assert "rank 1" in errors[0]


def test_mpi_of_one_thread_is_refused(tmp_path: Path) -> None:
    assert all("MPI_THREAD_SERIALIZED" in line for line in said(2, "thread", tmp_path))
