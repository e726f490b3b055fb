"""docker/prometheus and docker/grafana against a live server, scraped by a real Prometheus.

What rules and panels ask for is there; docs/running/metrics.md lists what the server tells, all of it.
"""

from __future__ import annotations

import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.parse
import urllib.request
from typing import Any

import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "clients" / "python"))

import stellate  # noqa: E402

PROMETHEUS = ROOT / "docker" / "prometheus"
GRAFANA = ROOT / "docker" / "grafana"
RULES_TEST = pathlib.Path(__file__).resolve().parent / "prometheus" / "rules_test.yml"
PATIENCE = 60.0  # seconds: for a hang, not for a measurement
# What Grafana puts in the place of its variables.
_VARIABLES = {"$job": ".*", "$instance": ".*", "$__rate_interval": "5s"}
_NAME = re.compile(r"\b(?:stellate|process)_\w+")
_SUFFIX = re.compile(r"_(bucket|count|sum)$")


def rules() -> list[dict[str, Any]]:
    """The alerts."""
    groups = yaml.safe_load((PROMETHEUS / "rules.yml").read_text())["groups"]
    return [rule for group in groups for rule in group["rules"]]


def dashboard() -> dict[str, Any]:
    """The one there is."""
    return json.loads((GRAFANA / "dashboards" / "stellate.json").read_text())


def questions() -> dict[str, str]:
    """Every expression of the dashboard, by its panel."""
    found = {}
    for panel in dashboard()["panels"]:
        for target in panel["targets"]:
            expression = target["expr"]
            for variable, value in _VARIABLES.items():
                expression = expression.replace(variable, value)
            found[f"{panel['title']} {target['refId']}"] = expression
    return found


class Files(unittest.TestCase):
    def test_every_alert_fires_and_is_silent_in_its_test(self) -> None:
        done = subprocess.run(
            ["promtool", "test", "rules", RULES_TEST], capture_output=True, text=True
        )
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        tested = {case["name"] for case in yaml.safe_load(RULES_TEST.read_text())["tests"]}
        wanted = {f"{r['alert']} {does}" for r in rules() for does in ("fires", "is silent")}
        self.assertEqual(tested, wanted)

    def test_prometheus_takes_its_configuration(self) -> None:
        done = subprocess.run(
            ["promtool", "check", "config", PROMETHEUS / "prometheus.yml"],
            capture_output=True,
            text=True,
        )
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn(f"SUCCESS: {len(rules())} rules found", done.stdout)

    def test_the_dashboard_is_whole(self) -> None:
        board = dashboard()
        variables = {variable["name"] for variable in board["templating"]["list"]}
        taken: set[tuple[int, int]] = set()
        for panel in board["panels"]:
            where = panel["gridPos"]
            cells = {
                (where["x"] + i, where["y"] + j)
                for i in range(where["w"])
                for j in range(where["h"])
            }
            self.assertFalse(cells & taken, f"{panel['title']} lies on another")
            self.assertLessEqual(where["x"] + where["w"], 24, panel["title"])
            taken |= cells
            used = set(re.findall(r"\$\{?(\w+)", json.dumps(panel))) - {"__rate_interval"}
            self.assertLessEqual(used, variables, panel["title"])
        self.assertEqual(len({p["id"] for p in board["panels"]}), len(board["panels"]))
        self.assertEqual(len({p["title"] for p in board["panels"]}), len(board["panels"]))

    def test_grafana_finds_prometheus_and_the_dashboard(self) -> None:
        compose = yaml.safe_load((ROOT / "docker" / "compose.yaml").read_text())["services"]
        sources = yaml.safe_load((GRAFANA / "provisioning/datasources/prometheus.yaml").read_text())
        url = urllib.parse.urlsplit(sources["datasources"][0]["url"])
        self.assertIn(url.hostname, compose)
        default = dashboard()["templating"]["list"][0]["current"]["value"]
        self.assertEqual(sources["datasources"][0]["uid"], default)
        providers = yaml.safe_load((GRAFANA / "provisioning/dashboards/stellate.yaml").read_text())
        mounted = [volume.split(":")[1] for volume in compose["grafana"]["volumes"]]
        self.assertIn(providers["providers"][0]["options"]["path"], mounted)
        self.assertIn("/etc/grafana/provisioning", mounted)


class Live(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        scratch = tempfile.TemporaryDirectory()
        cls.addClassCleanup(scratch.cleanup)
        folder = pathlib.Path(scratch.name)
        ready = folder / "ready"
        log = (folder / "server.log").open("w")
        server = subprocess.Popen(
            [os.environ["STELLATED"], f"--listen=unix:{folder}/socket", "--metrics-listen=127.0.0.1:0",
             f"--ready-file={ready}", "--max-meshes=1"], stdout=log, stderr=log,
        )  # fmt: skip
        cls._ends(server)
        while not ready.exists():
            assert server.poll() is None, "the server does not start"
            time.sleep(0.01)
        cls.metrics = cls._metrics_address(server.pid)
        with stellate.Client(f"unix:{folder}/socket") as client:
            stellate.mesh(stellate.manifolds.Sphere(), epsilon=0.5, server=client)
            client.create(stellate.manifolds.Sphere(), epsilon=0.5)
            try:
                client.create(stellate.manifolds.Sphere(), epsilon=0.5)
            except stellate.StellateError as error:
                assert "max-meshes" in str(error), error
            cls.prometheus = cls._start_prometheus(folder)
            cls._wait("count_over_time(stellate_workers[1m]) > 2 and stellate_meshes_idle == 1")

    @classmethod
    def _ends(cls, process: subprocess.Popen) -> None:
        cls.addClassCleanup(process.wait, PATIENCE)
        cls.addClassCleanup(process.kill)

    @classmethod
    def _metrics_address(cls, pid: int) -> str:
        """Where the process listens: its other socket is a unix one."""
        inodes = {os.readlink(fd) for fd in _links(f"/proc/{pid}/fd")}
        for line in pathlib.Path("/proc/net/tcp").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and f"socket:[{fields[9]}]" in inodes:
                return f"127.0.0.1:{int(fields[1].split(':')[1], 16)}"
        raise SystemError("the server listens for nobody")

    @classmethod
    def _start_prometheus(cls, folder: pathlib.Path) -> str:
        """As it ships, except where the server is and how often it is asked."""
        text = (PROMETHEUS / "prometheus.yml").read_text()
        for old, new in (("stellated:9717", cls.metrics), ("interval: 5s", "interval: 200ms")):
            assert old in text, old
            text = text.replace(old, new)
        (folder / "prometheus.yml").write_text(text)
        (folder / "rules.yml").write_text((PROMETHEUS / "rules.yml").read_text())
        log = folder / "prometheus.log"
        process = subprocess.Popen(
            ["prometheus", f"--config.file={folder}/prometheus.yml", f"--storage.tsdb.path={folder}/data",
             "--web.listen-address=127.0.0.1:0"], stdout=subprocess.DEVNULL, stderr=log.open("w"),
        )  # fmt: skip
        cls._ends(process)
        while "Server is ready" not in log.read_text():
            assert process.poll() is None, log.read_text()
            time.sleep(0.05)
        return f"http://{cls._metrics_address(process.pid)}"

    @classmethod
    def ask(cls, expression: str) -> list[dict[str, Any]]:
        """What Prometheus answers. Raises: urllib's HTTPError where it is no expression."""
        query = urllib.parse.urlencode({"query": expression})
        with urllib.request.urlopen(
            f"{cls.prometheus}/api/v1/query?{query}", timeout=PATIENCE
        ) as reply:
            return json.load(reply)["data"]["result"]

    @classmethod
    def _wait(cls, expression: str) -> None:
        end = time.monotonic() + PATIENCE
        while not cls.ask(expression):
            assert time.monotonic() < end, f"never: {expression}"
            time.sleep(0.1)

    def test_every_panel_shows_something(self) -> None:
        for panel, expression in questions().items():
            with self.subTest(panel):
                answer = self.ask(expression)
                self.assertTrue(answer, expression)

    def test_rules_ask_for_what_there_is(self) -> None:
        names = {series["metric"]["__name__"] for series in self.ask('{__name__=~".+"}')}
        for rule in rules():
            self.ask(rule["expr"])
            used = set(_NAME.findall(rule["expr"]))
            self.assertLessEqual(used, names, rule["alert"])
            for name, inside in re.findall(r"(\w+)\{([^}]*)\}", rule["expr"]):
                if re.search(r"state=", inside):  # their values, too, are some that occur
                    self.assertTrue(self.ask(f"{name}{{{inside}}}"), rule["alert"])

    def test_the_idle_mesh_is_seen(self) -> None:
        """The expression that docs once gave for it was empty always: its sides' labels differed."""
        (rule,) = (rule for rule in rules() if rule["alert"] == "StellateMeshesIdle")
        self.assertEqual(len(self.ask(rule["expr"])), 1)

    def test_docs_list_what_the_server_tells(self) -> None:
        with urllib.request.urlopen(f"http://{self.metrics}/metrics", timeout=PATIENCE) as reply:
            told = set(re.findall(r"^# TYPE (\w+) ", reply.read().decode(), re.M))
        page = (ROOT / "docs" / "running" / "metrics.md").read_text()
        rows = re.findall(r"^\| (`.*?) \|", page, re.M)
        listed = {
            re.sub(r"\{.*", "", name) for row in rows for name in re.findall(r"`([^`]+)`", row)
        }
        own = {name for name in told if name.startswith(("stellate_", "process_"))}
        self.assertEqual({name for name in listed if _NAME.fullmatch(name)}, own)
        for expression in filter(_NAME.search, re.findall(r"^ {4}(\S.*)$", page, re.M)):
            with self.subTest(expression):
                self.ask(expression.split("  #")[0])
                used = {_SUFFIX.sub("", name) for name in _NAME.findall(expression)}
                self.assertLessEqual(used, own)


def _links(folder: str) -> list[str]:
    return [f"{folder}/{name}" for name in os.listdir(folder)]


if __name__ == "__main__":
    unittest.main()
