"""Files that editors, forges and hooks read name commands that exist, and every file is as .editorconfig
says. That they fit their schemas is seen by `tools/check forge`."""

from __future__ import annotations

import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
from collections.abc import Iterator
from typing import Any

import editorconfig
import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "docs"))
import shell  # noqa: E402
from blocks import Wrong  # noqa: E402

WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
_EXPRESSION = re.compile(r"\$\{\{.*?\}\}")


def parsed(path: pathlib.Path) -> Any:
    return yaml.safe_load(path.read_text())


def tracked() -> list[pathlib.Path]:
    """The repository's files; none where it is no clone."""
    command = ["git", "-c", f"safe.directory={ROOT}", "-C", ROOT, "ls-files", "-z"]
    done = subprocess.run(command, capture_output=True, text=True)
    return [ROOT / name for name in done.stdout.split("\0") if name and (ROOT / name).is_file()]


def scripts(workflow: Any) -> Iterator[str]:
    """What a workflow runs: its steps, and the commands that it hands to another workflow."""
    for job in workflow["jobs"].values():
        yield from (step["run"] for step in job.get("steps", ()) if "run" in step)
        yield from job.get("strategy", {}).get("matrix", {}).get("command", ())


def actions(workflow: Any) -> Iterator[str]:
    """The actions and workflows of others that a workflow takes."""
    for job in workflow["jobs"].values():
        yield from (one["uses"] for one in (job, *job.get("steps", ())) if "uses" in one)


def faults(script: str) -> list[str]:
    """What of a script does not exist."""
    found = []
    try:
        for command in shell.commands(_EXPRESSION.sub("expression", script)):
            shell.programs_exist(command)
    except Wrong as error:
        found.append(str(error))
    return found


def untidy(path: pathlib.Path) -> list[str]:
    """What of a file is not as .editorconfig says."""
    says = editorconfig.get_properties(str(path))
    content = path.read_bytes()
    if b"\0" in content[:8000] or not content:
        return []
    try:
        text = content.decode(says["charset"])
    except UnicodeDecodeError:
        return ["is not UTF-8"] if path.suffix not in (".stl", ".ply") else []
    found = []
    if says["end_of_line"] == "lf" and "\r\n" in text:
        found.append("has lines that end in CR LF")
    if says["insert_final_newline"] == "true" and not text.endswith("\n"):
        found.append("has no newline at its end")
    if says["trim_trailing_whitespace"] == "true" and re.search(r"[ \t]$", text, re.M):
        found.append("has spaces at the end of a line")
    if says["indent_style"] == "space" and re.search(r"^ *\t", text, re.M):
        found.append("is indented by tabs")
    return found


class Workflows(unittest.TestCase):
    def test_they_run_what_exists(self) -> None:
        for path in WORKFLOWS:
            for script in scripts(parsed(path)):
                self.assertEqual(faults(script), [], path.name)

    def test_together_they_run_all(self) -> None:
        all_of_it = [script for path in WORKFLOWS for script in scripts(parsed(path))]
        stages = ("--asan", "--tsan", "--languages", "--packages", "--postgres", "--mpi")
        for command in (".ci/run", *(f"tests/run {stage}" for stage in stages)):
            self.assertIn(command, all_of_it)

    def test_actions_are_pinned_by_major_version_and_ours_exist(self) -> None:
        for path in WORKFLOWS:
            for action in actions(parsed(path)):
                if action.startswith("./"):
                    self.assertTrue((ROOT / action).is_file(), f"{path.name}: {action}")
                else:
                    self.assertRegex(action, r"\A[\w.-]+/[\w.-]+@v\d+\Z", path.name)

    def test_containers_are_the_base_of_our_images(self) -> None:
        images = (ROOT / "docker" / "images.txt").read_text()
        base = re.search(r"(?m)^STELLATE_BASE\s+(\S+)", images)
        assert base
        found = [
            job["container"]["image"]
            for path in WORKFLOWS for job in parsed(path)["jobs"].values() if "container" in job
        ]  # fmt: skip
        self.assertTrue(found)
        self.assertEqual(set(found), {base[1]})

    def test_what_does_not_exist_is_seen(self) -> None:
        self.assertEqual(faults("tests/run --asan\napt-get update\n"), [])
        for wrong in ("tests/run --asam", "tests/rum", "echo x && .ci/run --al", "if true"):
            with self.subTest(wrong):
                self.assertTrue(faults(wrong))


class Hooks(unittest.TestCase):
    def test_they_are_steps_of_the_check(self) -> None:
        usage = re.findall(r"(?m)^#   (\w+)  ", (ROOT / "tools" / "check").read_text())
        hooks = [
            hook
            for repo in parsed(ROOT / ".pre-commit-config.yaml")["repos"] for hook in repo["hooks"]
        ]  # fmt: skip
        self.assertTrue(hooks)
        for hook in hooks:
            program, *steps = hook["entry"].split()
            self.assertEqual((program, hook["language"]), ("tools/check", "system"))
            self.assertLessEqual(set(steps), set(usage), hook["id"])
            self.assertTrue(steps)


class Templates(unittest.TestCase):
    def test_files_and_commands_that_they_name_exist(self) -> None:
        for path in (ROOT / ".github").rglob("*"):
            if path.suffix not in (".md", ".yml") or path in WORKFLOWS:
                continue
            text = path.read_text()
            for named in re.findall(r"\b[A-Z]+\.md\b", text):
                self.assertTrue((ROOT / named).exists(), f"{path.name}: {named}")
            for code in re.findall(
                r"`(?:python3 )?((?:tests|tools|docs|proto|docker)/[^`]+)`", text
            ):
                self.assertTrue((ROOT / code.split()[0]).exists(), f"{path.name}: {code}")
                self.assertEqual(faults(code), [], path.name)


class Editors(unittest.TestCase):
    def test_every_file_is_as_they_would_write_it(self) -> None:
        wrong = [f"{path.relative_to(ROOT)} {what}" for path in tracked() for what in untidy(path)]
        self.assertEqual(wrong, [])

    def test_an_untidy_file_is_seen(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            (pathlib.Path(folder) / ".editorconfig").write_text(
                (ROOT / ".editorconfig").read_text()
            )
            for name, text, tidy in (
                ("a.cc", "int a;\n", True),
                ("a.go", "\ta\n", True),
                ("b.cc", "\tint a;\n", False),
                ("c.cc", "int a; \n", False),
                ("d.cc", "int a;", False),
                ("e.cc", "int a;\r\n", False),
            ):
                path = pathlib.Path(folder) / name
                path.write_bytes(text.encode())
                self.assertEqual(untidy(path) == [], tidy, name)


if __name__ == "__main__":
    unittest.main()
