"""The file identity.toml is the one place of who makes this; what cannot read it agrees with it."""

from __future__ import annotations

import json
import pathlib
import re
import subprocess
import sys
import unittest
import xml.etree.ElementTree as xml
from typing import Any

import tomllib
import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
import identity  # noqa: E402

IDENTITY = identity.read()
PERSON = f"{IDENTITY['maintainer']} <{IDENTITY['email']}>"
ANOTHER = {
    "home": "https://mesh.example.net",
    "source": "https://code.example.net/mesh",
    "issues": "https://bugs.example.net/mesh",
    "maintainer": "The makers of something",
    "email": "makers@example.net",
    "licence": "MIT",
    "group": "net.example.mesh",
}


def text_of(path: str) -> str:
    return (ROOT / path).read_text()


class Identity(unittest.TestCase):
    def test_it_has_what_is_asked_of_it(self) -> None:
        self.assertEqual(set(IDENTITY), set(ANOTHER))

    def test_files_that_state_it_agree(self) -> None:
        for path in identity.STATED:
            text = text_of(path)
            self.assertEqual(identity.with_identity(path, text, IDENTITY), text, path)

    def test_a_new_one_is_set_everywhere(self) -> None:
        """Back again, the text is the same: no expression takes more than what it should."""
        gone = [*(IDENTITY[key] for key in ("home", "source", "issues", "email")), PERSON]
        for path in identity.STATED:
            text = text_of(path)
            new = identity.with_identity(path, text, ANOTHER)
            self.assertNotEqual(new, text, path)
            self.assertEqual([old for old in gone if old in new], [], path)
            self.assertEqual(identity.with_identity(path, new, IDENTITY), text, path)

    def test_a_file_that_does_not_state_it_is_seen(self) -> None:
        text = text_of("clients/rust/Cargo.toml").replace("homepage =", "home =")
        with self.assertRaisesRegex(ValueError, r"Cargo\.toml: nothing there is like"):
            identity.with_identity("clients/rust/Cargo.toml", text, IDENTITY)

    def test_no_other_file_states_it(self) -> None:
        command = ["git", "-c", f"safe.directory={ROOT}", "grep", "-lIF", "-e", IDENTITY["home"],
                   "-e", IDENTITY["email"]]  # fmt: skip
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
        if done.returncode > 1:
            self.skipTest("no clone")
        found = set(done.stdout.split()) - {"identity.toml"}
        self.assertEqual(found - set(identity.STATED), set())


class Metadata(unittest.TestCase):
    """As the tools of each language read it."""

    def holds(self, found: Any, *wanted: str) -> None:
        self.assertEqual(found, [IDENTITY.get(key, key) for key in wanted])

    def test_python(self) -> None:
        for client in ("python", "conform"):
            project = tomllib.loads(text_of(f"clients/{client}/pyproject.toml"))["project"]
            urls, author = project["urls"], project["authors"][0]
            self.holds([urls[key] for key in ("Homepage", "Source", "Issues")],
                       "home", "source", "issues")  # fmt: skip
            self.holds([author["name"], author["email"]], "maintainer", "email")
            self.holds([project["license"]["text"]], "licence")

    def test_node(self) -> None:
        package = json.loads(text_of("clients/node/package.json"))
        self.holds(
            [package[key] for key in ("author", "homepage", "bugs", "license")],
            PERSON, "home", "issues", "licence",
        )  # fmt: skip
        self.holds([package["repository"]["url"]], "source")

    def test_rust(self) -> None:
        package = tomllib.loads(text_of("clients/rust/Cargo.toml"))["package"]
        self.holds([*package["authors"], package["homepage"], package["repository"]],
                   PERSON, "home", "source")  # fmt: skip

    def test_java(self) -> None:
        pom = xml.fromstring(text_of("clients/java/pom.xml"))
        places = ("groupId", "url", "licenses/license/name", "developers/developer/email",
                  "scm/url", "issueManagement/url")  # fmt: skip
        found = [
            pom.findtext(re.sub(r"(^|/)", r"\1{http://maven.apache.org/POM/4.0.0}", place))
            for place in places
        ]
        self.holds(found, "group", "home", "licence", "email", "source", "issues")

    def test_r(self) -> None:
        fields = dict(re.findall(r"(?m)^(\w+): (.*)$", text_of("clients/r/DESCRIPTION")))
        self.holds([fields[key] for key in ("Maintainer", "URL", "BugReports")],
                   PERSON, "home", "issues")  # fmt: skip

    def test_citation(self) -> None:
        cited = yaml.safe_load(text_of("CITATION.cff"))
        self.holds(
            [cited[key] for key in ("url", "repository-code", "license")],
            "home", "source", "licence",
        )  # fmt: skip
        self.holds([cited["authors"][0]["name"]], "maintainer")

    def test_every_image_is_labelled(self) -> None:
        labels = re.findall(r'image\.(\w+)="(.*?)"', text_of("docker/Dockerfile"))
        for name, key in (("url", "home"), ("source", "source"), ("licenses", "licence")):
            self.holds([value for label, value in labels if label == name], key, key)


if __name__ == "__main__":
    unittest.main()
