"""Oracle workers as the containers start them: a mesh that is only declared gets made."""

from __future__ import annotations

import os
import pathlib
import subprocess
import sys
import tempfile
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
WORKER = [sys.executable, "-B", str(ROOT / "docker" / "oracle_worker.py")]
PATIENCE = 100.0  # seconds: for a hang, not for a measurement


class StandingWorkers(unittest.TestCase):
    def setUp(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        ready = pathlib.Path(self.folder.name) / "ready"
        command = [os.environ["STELLATED"], "--listen", "127.0.0.1:0", "--ready-file", str(ready)]
        self.processes = [subprocess.Popen([*command, "--log-level", "warning"])]
        while not ready.exists():
            self.assertIsNone(self.processes[0].poll())
            time.sleep(0.01)
        self.server = ready.read_text().strip()
        self.environment = {**os.environ, "PYTHONPATH": str(ROOT / "clients" / "python")}

    def tearDown(self) -> None:
        for process in self.processes:
            process.terminate()
        for process in self.processes:
            process.wait(PATIENCE)
        self.folder.cleanup()

    def start(self, *arguments: str) -> subprocess.Popen:
        """One more process, of the worker's program."""
        process = subprocess.Popen(
            [*WORKER, *arguments, "--server", self.server],
            env=self.environment,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.processes.append(process)
        self.addCleanup(process.stdout.close)
        return process

    def test_a_declared_mesh_is_made(self) -> None:
        self.start("--manifold", "torus")
        self.start("--manifold", "torus", "--all-servers")
        self.start("--manifold", "sphere")  # leaves it alone
        made = self.start("--make", "torus", "--epsilon", "0.2")
        report, _ = made.communicate(timeout=PATIENCE)
        self.assertEqual(made.returncode, 0, report)
        self.assertIn("Euler characteristic 0", report)

    def test_workers_with_an_oracle_of_the_users_own(self) -> None:
        folder = pathlib.Path(self.folder.name)
        (folder / "shapes.py").write_text(
            "from stellate import manifolds\nring = manifolds.Torus()\n"
        )
        self.environment["PYTHONPATH"] += os.pathsep + str(folder)
        self.start("--oracle", "shapes:ring")
        self.start("--manifold", "torus")  # another label: leaves it alone
        made = self.start("--make", "shapes:ring", "--epsilon", "0.2")
        report, _ = made.communicate(timeout=PATIENCE)
        self.assertEqual(made.returncode, 0, report)
        absent = self.start("--oracle", "shapes:absent")
        self.assertEqual(absent.wait(PATIENCE), 2)


if __name__ == "__main__":
    unittest.main()
