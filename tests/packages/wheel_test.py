"""The wheels: by pip into an environment of their own, with nothing of ours within reach."""

from __future__ import annotations

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import zipfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
VERSION = (ROOT / "VERSION").read_text().strip()
GRPC = subprocess.run(
    [ROOT / "packaging" / "grpc" / "build", "--bill"], capture_output=True, text=True, check=True
).stdout.split()[1]
MESH = """
import os, pathlib, subprocess, sys
import google.protobuf, grpc
started = []
sys.addaudithook(lambda event, about: event == "subprocess.Popen" and started.append(about))
import stellate
assert not started, started  # no protoc: the wheel carries the stubs
assert stellate.__version__ == sys.argv[1], stellate.__version__
inside = pathlib.Path(stellate.__file__).parent
found = stellate.server.find_stellated()
assert pathlib.Path(found).is_relative_to(inside), found
mesh = stellate.mesh(stellate.manifolds.Torus(), epsilon=0.2)
assert mesh.certified and len(mesh.simplices) == 2 * len(mesh.points), mesh
mesh.save("torus.vtu")
mesh.show("torus.html")
assert "<canvas" in (page := pathlib.Path("torus.html").read_text()) and len(page) > 100_000
print(grpc.__file__, google.protobuf.__version__, grpc.__version__)
"""


def run(*command: str | pathlib.Path, **options: str | pathlib.Path) -> str:
    """What a command prints, in an environment that knows of nothing."""
    kept = re.compile(r"HOME|PIP_.*|https?_proxy|SSL_CERT_FILE", re.I)  # the way to PyPI
    environment = {name: value for name, value in os.environ.items() if kept.fullmatch(name)}
    environment["PATH"] = "/usr/bin:/bin"
    done = subprocess.run(command, capture_output=True, text=True, env=environment, **options)
    assert done.returncode == 0, f"{command}\n{done.stdout[-3000:]}{done.stderr[-3000:]}"
    return done.stdout


class Wheel(unittest.TestCase):
    wheel: pathlib.Path
    kit: pathlib.Path

    @classmethod
    def setUpClass(cls) -> None:
        folder = tempfile.TemporaryDirectory(prefix="stellate-wheel-test-")
        cls.addClassCleanup(folder.cleanup)
        made = subprocess.run(
            [ROOT / "packaging" / "wheel", folder.name],
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
        cls.wheel, cls.kit = map(pathlib.Path, made.stdout.splitlines())
        cls.folder = pathlib.Path(folder.name)

    def environment(self, name: str, *options: str) -> pathlib.Path:
        """Its Python."""
        folder = self.folder / name
        run("/usr/bin/python3", "-m", "venv", *options, folder)
        return folder / "bin" / "python"

    def mesh(self, python: pathlib.Path) -> str:
        with tempfile.TemporaryDirectory() as nowhere:
            said = run(python, "-I", "-c", MESH, VERSION, cwd=nowhere)
            self.assertEqual(sorted(os.listdir(nowhere)), ["torus.html", "torus.vtu"])
            command = python.with_name("stellate")
            self.assertIn(VERSION, run(command, "--version", cwd=nowhere))
            run(command, "mesh", "torus", "-e", "0.3", "-o", "torus.off", cwd=nowhere)
        return said

    def test_with_what_pypi_has(self) -> None:
        python = self.environment("pypi")
        run(python, "-m", "pip", "install", "--quiet", self.wheel)
        said = self.mesh(python)
        self.assertTrue(said.startswith(str(self.folder)), said)

    def test_with_what_debian_has(self) -> None:
        python = self.environment("debian", "--system-site-packages")
        run(python, "-m", "pip", "install", "--quiet", "--no-index", self.wheel)
        said = self.mesh(python)
        self.assertTrue(said.startswith("/usr/lib/python3/"), said)

    def test_the_kit_is_in_a_wheel_of_its_own(self) -> None:
        names = zipfile.ZipFile(self.wheel).namelist()
        self.assertEqual([name for name in names if "conform" in name], [])
        names = zipfile.ZipFile(self.kit).namelist()
        self.assertEqual({name.split("-")[0].split("/")[0] for name in names}, {"stellate_conform"})
        python = self.environment("kit", "--system-site-packages")
        # Its one dependency is the client of this version; from anywhere else it would not come.
        run(python, "-m", "pip", "install", "--quiet", "--no-index", self.wheel, self.kit)
        with tempfile.TemporaryDirectory() as nowhere:
            client = pathlib.Path(shutil.copy(ROOT / "tests/conformance/python_client.py", nowhere))
            kit = python.with_name("stellate-conform")
            for rules in (
                "hello",
                "torus",
            ):  # which need the package, and the files that it carries
                said = run(kit, "--only", rules, "--", python, client, cwd=nowhere)
                self.assertRegex(said, r"(?m)^[1-9]\d* passed, 0 failed")

    def test_its_server_finds_its_libraries_in_the_wheel(self) -> None:
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            zipfile.ZipFile(self.wheel).extractall(folder)
            bundled = folder / "stellate" / "_bundled"
            programs = [bundled / "stellated", bundled / "stellate"]
            programs[0].chmod(0o755)  # pip does, zipfile does not
            self.assertEqual(
                run(programs[0], "--version"),
                f"stellated {VERSION} (gRPC {GRPC})\n",
                "of packaging/grpc/build",
            )
            for file in [*programs, *(bundled / "lib").iterdir()]:
                for library, path in re.findall(r"(\S+) => (\S+)", run("ldd", file)):
                    of_the_machine = re.match(r"lib(c|m|stdc\+\+|gcc_s)\.so", library)
                    if not of_the_machine:
                        self.assertEqual(path, str(bundled / "lib" / library))
            hardening = ROOT / "tests" / "packages" / "hardening_test.py"
            run("/usr/bin/python3", "-B", hardening, *programs)
            licences = {file.name for file in (bundled / "licences").iterdir()}
            self.assertLessEqual({"stellate", "grpc", "libssl3", "libtbb12"}, licences)
            self.assertFalse(list((bundled / "lib").glob("libgrpc*")), "Debian's, too")

    def test_its_server_stands_what_is_known_against_its_grpc(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            zipfile.ZipFile(self.wheel).extractall(folder)
            server = pathlib.Path(folder) / "stellate" / "_bundled" / "stellated"
            server.chmod(0o755)
            known = ROOT / "tests" / "container" / "advisories_test.py"
            subprocess.run(
                ["/usr/bin/python3", "-B", known, "Abort", "Poison"],
                env={**os.environ, "STELLATED": str(server)}, check=True,
            )  # fmt: skip

    def test_its_grpc_reports_what_strangers_make_it_hold(self) -> None:
        """As Debian's is made to, in the suite."""
        with_tests = ["cmake", "--preset", "package", "-DSTELLATE_TESTS=ON", "--log-level=NOTICE"]
        build = ["cmake", "--build", "--preset", "package", "--target", "server_grpc_parts_test"]
        for command in (with_tests, build, [ROOT / "build/package/bin/server_grpc_parts_test"]):
            done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stdout[-3000:] + done.stderr[-3000:])

    def test_it_names_its_platform(self) -> None:
        self.assertRegex(
            self.wheel.name, rf"^stellate-{re.escape(VERSION)}-py3-none-manylinux_2_34_\w+\.whl$"
        )


if __name__ == "__main__":
    unittest.main(argv=sys.argv)
