"""Holds docker/helm/stellate, as far as it can be read without helm; helm_test.py renders it."""

from __future__ import annotations

import copy
import json
import os
import re
import subprocess
import unittest
from typing import Any

import jsonschema
import yaml
from kubernetes_objects import MANIFESTS, ROOT, kustomization, version

CHART = ROOT / "docker" / "helm" / "stellate"
# What the chart itself gives the server.
_GIVEN = {
    "listen", "ready-file", "data-dir", "database", "peer-address", "insecure-listen", "tls-cert", "tls-key",
    "token-file", "metrics-listen", "log-format", "drain-seconds",
}  # fmt: skip
_TYPES: dict[str, dict[str, Any]] = {
    "UINT": {"type": "integer", "minimum": 0},
    "INT": {"type": "integer"},
    "FLOAT": {"type": "number"},
    "TEXT": {"type": "string"},
    "": {"type": "boolean"},
}

# Where, what instead, and a word of the complaint. helm_test.py shows the same to helm.
REFUSED: list[tuple[str, Any, str]] = [
    ("server.replicas", 0, "minimum"),
    ("server.replicas", "two", "integer"),
    ("server.replica", 3, "replica"),
    ("server.settings", {"max-mesh": 3}, "max-mesh"),
    ("server.settings", {"max-meshes": -1}, "minimum"),
    ("server.settings", {"listen": "0.0.0.0:1"}, "listen"),
    ("server.env", [{"value": "x"}], "name"),
    ("server.env", [{"name": "OTEL X"}], "OTEL X"),
    ("server.resources", {"limits": {"memory": None}}, "string"),
    ("server.resources", {"limits": {"memory": "4 GB"}}, "4 GB"),
    ("storage.kind", "disk", "disk"),
    ("storage.database.port", 0, "minimum"),
    ("images.server.digest", "sha256:abc", "sha256"),
    ("images.proxy", {"repository": "haproxy", "tag": ""}, "anyOf"),
    ("workers", [{"name": "torus"}], "token"),
    ("workers", [{"name": "Torus"}], "Torus"),
    ("secrets.files", {"tokens": {"key": "tokens"}}, "secret"),
    ("secrets.name", "Stellate", "Stellate"),
    ("proxy.service.type", "Balancer", "Balancer"),
    ("metrics.serviceMonitor.interval", "soon", "soon"),
    ("networkPolicy.clients", [{}], "minProperties"),
    ("persistence", {"size": "1Gi"}, "persistence"),
]


def values() -> dict[str, Any]:
    """What it takes where its user says nothing."""
    return dict(yaml.safe_load((CHART / "values.yaml").read_text()))


def schema() -> dict[str, Any]:
    """What it may be given."""
    return dict(json.loads((CHART / "values.schema.json").read_text()))


def documented() -> dict[str, Any]:
    """The values that docs/running/clusters.md shows."""
    page = (ROOT / "docs" / "running" / "clusters.md").read_text()
    return dict(yaml.safe_load(page.split("```yaml\n")[1].split("```")[0]))


def put(tree: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """The same with another value there."""
    tree = copy.deepcopy(tree)
    place = tree
    *way, last = path.split(".")
    for step in way:
        place = place[step]
    place[last] = value
    return tree


class Chart(unittest.TestCase):
    def test_its_values_are_what_it_takes(self) -> None:
        jsonschema.Draft202012Validator.check_schema(schema())
        jsonschema.validate(values(), schema(), jsonschema.Draft202012Validator)

    def test_it_takes_what_the_docs_show(self) -> None:
        shown = documented()
        self.assertEqual(shown["storage"]["kind"], "database")
        jsonschema.validate(shown, schema(), jsonschema.Draft202012Validator)

    def test_wrong_values_are_refused(self) -> None:
        validator = jsonschema.Draft202012Validator(schema())
        for path, value, word in REFUSED:
            with self.subTest(path=path, value=value):
                found = list(validator.iter_errors(put(values(), path, value)))
                said = "\n".join(f"{e.message} {e.validator}" for e in found)
                self.assertIn(word, said)

    def test_the_schema_knows_every_setting_of_the_server(self) -> None:
        shown = subprocess.run([os.environ["STELLATED"], "--help"], capture_output=True, text=True)
        text = shown.stdout[shown.stdout.index("--listen TEXT") :]
        flags = dict(re.findall(r"^  --([a-z-]+)(?: (UINT|INT|FLOAT|TEXT))?", f"  {text}", re.M))
        self.assertLessEqual(_GIVEN, set(flags))
        wanted = {flag: _TYPES[kind] for flag, kind in flags.items() if flag not in _GIVEN}
        known = schema()["properties"]["server"]["properties"]["settings"]["properties"]
        self.assertEqual(known, wanted)

    def test_every_part_of_the_values_says_what_it_is(self) -> None:
        lines = (CHART / "values.yaml").read_text().splitlines()
        for number, line in enumerate(lines):
            if re.match(r"[a-z]\w*:", line) and line.split(":")[0] not in ("server", "tolerations"):
                near = (
                    f"{lines[number - 1]}\n{lines[number + 1] if number + 1 < len(lines) else ''}"
                )
                self.assertIn("#", near, line)

    def test_versions_are_of_this_tree(self) -> None:
        chart = yaml.safe_load((CHART / "Chart.yaml").read_text())
        self.assertEqual((chart["version"], chart["appVersion"]), (version(), version()))
        tags = {image["name"]: image["newTag"] for image in kustomization()["images"]}
        self.assertEqual(values()["images"]["proxy"]["tag"], tags["haproxy"])

    def test_there_is_one_configuration_of_the_proxy(self) -> None:
        link = CHART / "files" / "haproxy.cfg"
        self.assertTrue(link.is_symlink())
        self.assertEqual(link.resolve(), (MANIFESTS / "haproxy.cfg").resolve())


if __name__ == "__main__":
    unittest.main()
