"""The Debian package of stellate-mpi, packed from the build that is tested."""

from __future__ import annotations

import gzip
import os
import subprocess
import sys
from pathlib import Path

from jobs import ROOT, run


def said(*words: str | Path) -> str:
    done = run(words)
    assert done.returncode == 0, (done.stdout, done.stderr)
    return done.stdout


def test_it_has_the_program_its_manual_and_what_it_needs(tmp_path: Path) -> None:
    build = Path(os.environ["STELLATE_MPI"]).parents[1]
    said(
        *("cpack", "--config", build / "CPackConfig.cmake", "-B", tmp_path),
        *("-D", "CPACK_COMPONENTS_ALL=mpi"),
    )
    [package] = tmp_path.glob("*.deb")
    assert package.name.startswith("stellate-mpi_")
    needs = said("dpkg-deb", "--field", package, "Depends")
    assert "openmpi-bin" in needs and "libopenmpi3" in needs
    said("dpkg-deb", "--extract", package, tmp_path / "root")
    usr = tmp_path / "root" / "usr"
    files = {str(path.relative_to(usr)) for path in usr.rglob("*") if path.is_file()}
    pages = {f"share/man/man1/{name}.1.gz" for name in ("stellate-mpi", "stellate-mpi-mesh")}
    assert files == pages | {"bin/stellate-mpi", "share/doc/stellate-mpi/copyright"}
    for page in pages:
        assert b"ranks of an MPI job" in gzip.decompress((usr / page).read_bytes())
    hardening = ROOT / "tests" / "packages" / "hardening_test.py"
    subprocess.run([sys.executable, "-B", hardening, usr / "bin" / "stellate-mpi"], check=True)
