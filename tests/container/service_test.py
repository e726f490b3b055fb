"""packaging/: the unit, its user and its directories, held to systemd's own programs."""

from __future__ import annotations

import configparser
import os
import pathlib
import re
import subprocess
import tempfile
import unittest

import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]
PACKAGING = ROOT / "packaging"
_EXPOSURE = (
    20  # tenths: what `systemd-analyze security` makes of the unit, 0 to 100; lower is better
)


def run(*command: str | pathlib.Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True)


class Service(unittest.TestCase):
    def setUp(self) -> None:
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.root = pathlib.Path(scratch.name)
        # A source tree with what was built, wherever that is.
        tree = self.root / "tree"
        (tree / "build" / "release").mkdir(parents=True)
        (tree / "build/release/bin").symlink_to(pathlib.Path(os.environ["STELLATED"]).parent)
        (tree / "packaging").mkdir()
        for file in filter(pathlib.Path.is_file, PACKAGING.iterdir()):
            (tree / "packaging" / file.name).write_bytes(file.read_bytes())
        (tree / "packaging/install").chmod(0o755)
        self.install = tree / "packaging/install"
        os.environ["DESTDIR"] = str(self.root)
        self.addCleanup(os.environ.pop, "DESTDIR")
        done = run(self.install)
        self.assertEqual(done.returncode, 0, done.stderr)
        (self.root / "etc/passwd").write_text("root:x:0:0:root:/root:/bin/sh\n")
        (self.root / "etc/group").write_text("root:x:0:\n")
        self.unit = configparser.RawConfigParser(strict=False, delimiters="=")
        self.unit.optionxform = str  # type: ignore[assignment, method-assign]
        self.unit.read(PACKAGING / "stellated.service")

    def test_systemd_takes_the_unit(self) -> None:
        unit = self.root / "etc/systemd/system/stellated.service"
        text = unit.read_text().replace("/usr/local/bin", f"{self.root}/usr/local/bin")
        unit.write_text(text)
        done = run("systemd-analyze", "verify", "--man=no", unit)
        self.assertNotIn("stellated.service", done.stdout + done.stderr)
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_the_unit_is_confined(self) -> None:
        unit = PACKAGING / "stellated.service"
        done = run(
            "systemd-analyze", "security", "--offline=true", f"--threshold={_EXPOSURE}", unit
        )
        self.assertEqual(done.returncode, 0, done.stdout[-2000:] + done.stderr)

    def test_systemd_makes_the_user_and_the_directories(self) -> None:
        for _ in range(2):
            done = run("systemd-sysusers", f"--root={self.root}", "stellate.conf")
            self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(
            (self.root / "etc/passwd").read_text(),
            r"\nstellate:!?\*?x?:\d+:\d+:Stellate:/var/lib/stellate:/usr/sbin/nologin\n",
        )
        if os.geteuid() == 0:  # they are given away
            done = run("systemd-tmpfiles", "--create", f"--root={self.root}", "stellate.conf")
            self.assertEqual(done.returncode, 0, done.stderr)
            record = (self.root / "var/lib/stellate").stat()
            self.assertEqual(record.st_mode & 0o777, 0o700)
            self.assertNotEqual(record.st_uid, 0)

    def test_the_unit_and_the_configuration_agree(self) -> None:
        service = self.unit["Service"]
        config = tomllib.loads((PACKAGING / "stellated.toml").read_text())
        self.assertIn(f"u {service['User']} ", (PACKAGING / "stellate.sysusers").read_text())
        self.assertGreaterEqual(int(service["TimeoutStopSec"]), config["drain-seconds"] + 10)
        self.assertEqual(config["data-dir"], f"/var/lib/{service['StateDirectory']}")
        program, *arguments = service["ExecStart"].split()
        self.assertEqual(program, "/usr/local/bin/stellated")
        self.assertEqual(arguments, ["--config", "/etc/stellate/stellated.toml"])
        done = run(
            os.environ["STELLATED"], "--config", PACKAGING / "stellated.toml", "--print-config"
        )
        self.assertEqual(done.returncode, 0, done.stderr)
        printed = tomllib.loads(done.stdout)
        self.assertEqual({key: printed[key] for key in config}, config)
        for key in ("tls-cert", "tls-key", "token-file"):
            self.assertTrue(config[key].startswith("/etc/stellate/"))
        self.assertNotIn("insecure-listen", config)

    def test_a_configuration_that_is_there_stays(self) -> None:
        config = self.root / "etc/stellate/stellated.toml"
        config.write_text("max-meshes = 3\n")
        (self.root / "usr/local/bin/stellated").write_text("the old one")
        done = run(self.install)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(config.read_text(), "max-meshes = 3\n")
        new = run(self.root / "usr/local/bin/stellated", "--version")
        self.assertTrue(re.match(r"stellated \d", new.stdout), new)


if __name__ == "__main__":
    unittest.main()
