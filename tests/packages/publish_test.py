"""packaging/publish: what it takes and refuses, without a build; and what it says it would upload."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import io
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest
from typing import Any
from unittest import mock

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "packaging" / "publish"


def loaded() -> Any:
    loader = importlib.machinery.SourceFileLoader("publish", str(PROGRAM))
    spec = importlib.util.spec_from_loader("publish", loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["publish"] = module  # which dataclasses look for
    loader.exec_module(module)
    return module


publish = loaded()


def called(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-B", PROGRAM, *arguments],
        capture_output=True, text=True, env={**os.environ, **environment},
    )  # fmt: skip


class Arguments(unittest.TestCase):
    def test_its_help_names_every_package(self) -> None:
        said = called("--help").stdout
        for name in publish.PACKAGES:
            self.assertIn(f"  {name} ", said)

    def test_mistakes_are_usage(self) -> None:
        for arguments, words in (
            (["egg"], "no package egg; there are wheel, npm"),
            (["--dry-run", "--upload"], "not allowed with"),
            (["--push"], "unrecognized"),
        ):
            done = called(*arguments)
            self.assertEqual((done.returncode, done.stdout), (2, ""))
            self.assertIn(words, done.stderr)

    def test_nothing_is_uploaded_to_a_reserved_domain(self) -> None:
        """Asked of the program itself this would upload, once there are registries."""
        reserved = dict.fromkeys(publish.PACKAGES, "https://packages.stellate.example/up")
        for names in ([], ["gem"], ["image", "r"]):
            with (
                mock.patch.object(publish.identity, "registries", lambda: reserved),
                mock.patch.object(publish, "publish", self.fail),
                mock.patch.object(sys, "argv", ["publish", "--upload", *names]),
                mock.patch("sys.stderr", new_callable=io.StringIO) as said,
            ):
                self.assertEqual(publish.main(), 2)
            self.assertIn(
                "nothing is uploaded: identity.toml has a reserved domain", said.getvalue()
            )

    def test_every_package_has_a_registry_and_no_registry_lacks_one(self) -> None:
        self.assertEqual(set(publish.identity.registries()), set(publish.PACKAGES))

    def test_where_no_tool_is_packages_are_left_out(self) -> None:
        with tempfile.TemporaryDirectory() as empty:
            done = called("--folder", f"{empty}/made", "gem", "npm", PATH=empty)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(
                done.stdout,
                "gem: left out, there is no gem, protoc, grpc_ruby_plugin here\n"
                "npm: left out, there is no npm here\n",
            )


class Uploads(unittest.TestCase):
    """With registries that are somebody's, and programs that note what they are asked."""

    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.real = {name: "https://packages.invalid.net/up" for name in publish.PACKAGES}

    def why(self, *names: str, status: str = "", tags: str = f"v{publish.VERSION}\n") -> str:
        def run(*command: str, **more: Any) -> str:
            return status if "status" in command else tags

        with mock.patch.object(publish, "run", run), mock.patch("shutil.which", lambda name: name):
            return str(publish.why_no_upload(names, self.real))

    def test_only_a_clean_tree_at_the_tag_goes_up(self) -> None:
        self.assertEqual(self.why("gem", "image"), "")
        self.assertIn("not clean", self.why("gem", status=" M README.md\n"))
        self.assertIn("tag v", self.why("gem", tags="v9.9.9\nother\n"))
        self.real["npm"] = "https://npm.stellate.example:8443/x"
        self.assertIn("reserved", self.why("gem", "npm"))
        del self.real["npm"]
        self.assertIn("no registry for npm", self.why("npm"))
        with mock.patch("shutil.which", lambda name: None):
            self.assertEqual(publish.why_no_upload(["r"], self.real), "r needs R, curl")

    def published(self, uploads: bool, fails: str = "") -> tuple[int, list[str]]:
        """The status, and the commands that were run."""
        ran: list[str] = []

        def build(scratch: pathlib.Path, folder: pathlib.Path) -> list[pathlib.Path]:
            return [folder / "stellate-1.tar.gz"]

        def broken(scratch: pathlib.Path, folder: pathlib.Path) -> list[pathlib.Path]:
            raise publish.Failed("it does not build")

        def run(*command: str, **more: Any) -> str:
            ran.append(" ".join(command))
            if fails and fails in ran[-1]:
                raise publish.Failed("no")
            return ""

        packages = {
            "gem": publish.Package(broken if fails == "build" else build, publish.put_gem, ()),
            "r": publish.Package(build, publish.put, ()),
        }
        with (
            mock.patch.object(publish, "run", run),
            mock.patch.dict(publish.PACKAGES, packages),
            mock.patch("builtins.print"),
        ):
            status = publish.publish(["gem", "r"], self.real, self.folder, self.folder, uploads)
        return status, ran

    def test_a_dry_run_runs_no_upload(self) -> None:
        self.assertEqual(self.published(uploads=False), (0, []))

    def test_all_goes_up_once_all_is_well(self) -> None:
        status, ran = self.published(uploads=True)
        self.assertEqual(status, 0)
        self.assertRegex(ran[0], "^gem push .*stellate-1.tar.gz --host https://packages")
        self.assertRegex(ran[1], "^curl .* https://packages.invalid.net/up/stellate-1.tar.gz$")

    def test_nothing_goes_up_where_one_does_not_build(self) -> None:
        self.assertEqual(self.published(uploads=True, fails="build"), (1, []))

    def test_it_stops_at_the_first_that_does_not_go_up(self) -> None:
        status, ran = self.published(uploads=True, fails="gem push")
        self.assertEqual((status, len(ran)), (1, 1))

    def test_the_tag_of_go_has_the_generated_code_and_leaves_branches_alone(self) -> None:
        clone, tree = self.folder / "clone", self.folder / "go" / "clients" / "go"
        git = ["git", "-c", "user.name=a", "-c", "user.email=a@b.example", "-C", str(clone)]
        subprocess.run(["git", "init", "--quiet", clone], check=True)
        (clone / "clients" / "go").mkdir(parents=True)
        (clone / "clients" / "go" / "go.mod").write_text("module stellate\n")
        (clone / ".gitignore").write_text("proto\n")
        subprocess.run([*git, "add", "."], check=True)
        subprocess.run([*git, "commit", "--quiet", "-m", "one"], check=True)
        (tree / "proto").mkdir(parents=True)
        (tree / "proto" / "a.pb.go").write_text("package proto\n")
        (tree / "go.mod").write_text("module stellate\n")
        tag, push = publish.put_go("there", [], self.folder)
        who = {f"GIT_{role}_{what}": "a@b.example" for role in ("AUTHOR", "COMMITTER")
               for what in ("NAME", "EMAIL")}  # fmt: skip
        subprocess.run(tag, cwd=clone, check=True, env={**os.environ, **who})
        self.assertEqual(push, ["git", "push", "there", f"clients/go/v{publish.VERSION}"])
        listed = subprocess.check_output(
            [*git, "ls-tree", "-r", "--name-only", push[-1]], text=True
        )
        self.assertIn("clients/go/proto/a.pb.go", listed.split())
        here = subprocess.check_output([*git, "ls-tree", "-r", "--name-only", "HEAD"], text=True)
        self.assertNotIn("clients/go/proto/a.pb.go", here.split())
        self.assertEqual(subprocess.check_output([*git, "status", "--porcelain"], text=True), "")


if __name__ == "__main__":
    unittest.main()
