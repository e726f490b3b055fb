"""A job that cannot end well ends in all ranks, says why once, and leaves no file."""

from __future__ import annotations

from pathlib import Path

import pytest
from jobs import job, oracle, ranks, refused, run


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (["torus", "-e", "auto"], ["epsilon", "stellate doctor"]),
        (["nowhere", "-e", ".1"], ["nowhere", "stellate list"]),
        (["torus", "-e", "-1"], ["epsilon is -1"]),
        (["torus", "-e", ".1", "--busy", "5"], ["--busy", "ranks wait"]),
        (["torus", "-e", ".1", "-o", "/nowhere/torus.vtu"], ["/nowhere/torus.vtu"]),
        (["so3", "-e", ".4", "-o", "so3.ply"], [".ply"]),
    ],
)
def test_what_is_refused(asked: list[str], words: list[str]) -> None:
    refused(job(2, *asked), 2, *words)


def test_ranks_with_different_manifolds(tmp_path: Path) -> None:
    file = tmp_path / "torus.vtu"
    one, other = (ranks(1, name, "-e", ".2", "-o", file) for name in ("torus:1:0.4", "torus:1:0.5"))
    refused(run(["mpirun", *one, ":", *other]), 2, "rank 1 has another manifold")
    assert not file.exists()


def test_an_oracle_that_ends_in_one_rank(tmp_path: Path) -> None:
    # With its script: torus.pl would go on reading, and the rank wait for it.
    command = oracle(tmp_path, 2000, "kill KILL => $ENV{SCRIPT}; exit")
    done = job(3, "--oracle-command", command, "-e", ".1", "-o", tmp_path / "torus.vtu")
    assert done.returncode == 3, done.stderr
    assert "rank 1: " in done.stderr
    assert list(tmp_path.iterdir()) == [tmp_path / "oracle"]


def test_a_rank_that_dies_ends_all(tmp_path: Path) -> None:
    command = oracle(tmp_path, 20000, "kill KILL => $ENV{RANK}; exit")
    done = job(3, "--oracle-command", command, "-e", ".05", "-o", tmp_path / "torus.vtu")
    assert done.returncode not in (0, 1, 2, 3), done.stderr
    assert list(tmp_path.iterdir()) == [tmp_path / "oracle"]
