"""Holds docker/'s Kubernetes manifests and compose file to what they are made for.

Each rule of manifests.py is shown to see mistakes: of every kind that it is there for, one is made
in a copy of the manifests. docker-compose checks the compose file.
"""

from __future__ import annotations

import copy
import os
import pathlib
import re
import subprocess
import tempfile
import time
import unittest
from typing import Any

import yaml

import manifests
from manifests import ROOT

COMPOSE = ROOT / "docker" / "compose.yaml"
_PATIENCE = 60.0  # seconds: for a hang, not for a measurement

_SERVER, _WORKERS = ("StatefulSet", "stellated"), ("Deployment", "oracle-torus")
_SERVICE, _SCALER = ("Service", "stellated"), ("HorizontalPodAutoscaler", "oracle-torus")
_BUDGET = ("PodDisruptionBudget", "stellated")
_OTHER_BUDGET = ("PodDisruptionBudget", "oracle-torus")
_CONTAINER = "spec.template.spec.containers.0"
_GONE = object()

# Where, what instead, and a word of the complaint.
MISTAKES: list[tuple[tuple[str, str], str, Any, str]] = [
    (_SERVER, f"{_CONTAINER}.livenesProbe", {}, "no such field"),
    (_SERVER, f"{_CONTAINER}.name", _GONE, "`name`"),
    (_SERVER, f"{_CONTAINER}.resources.requests.cpu", 1, "has to be str"),
    (_SERVER, f"{_CONTAINER}.resources.requests.memory", "1GB", "no quantity"),
    (_SERVER, "spec.replicas", "2", "has to be int"),
    (_SERVER, "spec.serviceName", _GONE, "service_name"),
    (_SERVER, f"{_CONTAINER}.readinessProbe.grpc.service", 5, "wrong type"),
    (_SERVER, f"{_CONTAINER}.readinessProbe.grpc.prot", 7717, "no field"),
    (_SERVER, "apiVersion", "apps/v1beta2", "is not where it is"),
    (_BUDGET, "apiVersion", "policy/v1beta1", "is not where it is"),
    (_BUDGET, "metadata.namespace", "default", "in no namespace"),
    (_WORKERS, f"{_CONTAINER}.image", "stellate-workers", "no image"),
    (_SERVER, "spec.selector.matchLabels", {"app": "stellated"}, "its own pods"),
    (_SERVER, "spec.template.metadata.labels", {"app": "x"}, "its own pods"),
    (_BUDGET, "spec.selector.matchLabels", {"app.kubernetes.io/name": "stelated"}, "pods of []"),
    (_BUDGET, "spec.selector.matchLabels", {"app.kubernetes.io/part-of": "stellate"}, "pods of ["),
    (_SERVICE, "spec.selector", {"app.kubernetes.io/name": "oracle-torus"}, "pods of ['oracle"),
    (_SCALER, "spec.scaleTargetRef.name", "oracle-sphere", "scales nothing"),
    (_WORKERS, "spec.replicas", 3, "autoscaler's"),
    (_SERVER, f"{_CONTAINER}.readinessProbe.grpc.port", 7718, "readinessProbe asks port 7718"),
    (_SERVER, f"{_CONTAINER}.startupProbe.grpc.port", 9717, "startupProbe asks port 9717"),
    (_SERVER, f"{_CONTAINER}.livenessProbe.tcpSocket.port", "gprc", "livenessProbe asks port gprc"),
    (_SERVER, f"{_CONTAINER}.livenessProbe", _GONE, "livenessProbe asks port None"),
    (_SERVER, f"{_CONTAINER}.ports.0.containerPort", 7000, "--listen="),
    (_SERVER, f"{_CONTAINER}.args.3", "--metrics-listen=0.0.0.0:9000", "--metrics-listen="),
    (_SERVER, "spec.template.metadata.annotations", {"prometheus.io/port": "80"}, "port 80"),
    (_SERVER, "spec.serviceName", "stellate", "no headless Service"),
    (_SERVICE, "spec.clusterIP", _GONE, "no headless Service"),
    (_SERVICE, "spec.ports.0.targetPort", "gprc", "leads to port gprc"),
    (_WORKERS, f"{_CONTAINER}.args.1", "--server=stellated:7718", "looks for a server"),
    (_SERVER, f"{_CONTAINER}.volumeMounts.0.name", "data", "mounts ['data']"),
    (_SERVER, f"{_CONTAINER}.volumeMounts.0.mountPath", "/var/lib/stellated", "in no volume"),
    (_SERVER, "spec.volumeClaimTemplates.0.spec.accessModes", ["ReadWriteMany"], "cannot share"),
    (_SERVER, "spec.template.spec.terminationGracePeriodSeconds", 30, "are killed after 30"),
    (_SERVER, f"{_CONTAINER}.args.5", "--drain-seconds=60", "drain for 60"),
    (_BUDGET, "spec.maxUnavailable", 0, "0 of 2 may leave"),
    (_BUDGET, "spec.maxUnavailable", 2, "2 of 2 may leave"),
    (_OTHER_BUDGET, "spec.minAvailable", 2, "0 of 2 may leave"),
    (_SCALER, "spec.maxReplicas", 1, "at most 1"),
    (_WORKERS, f"{_CONTAINER}.resources.requests.cpu", _GONE, "share of no request"),
    (_WORKERS, "spec.template.spec.securityContext.runAsUser", 0, "runAsUser is 0"),
    (_SERVER, "spec.template.spec.securityContext.fsGroup", 1000, "fsGroup is 1000"),
    (_SERVER, f"{_CONTAINER}.securityContext.readOnlyRootFilesystem", _GONE, "readOnlyRoot"),
    (_SERVER, f"{_CONTAINER}.securityContext.capabilities.add", ["NET_ADMIN"], "NET_ADMIN"),
    (_SERVER, "spec.template.spec.hostNetwork", True, "hostNetwork"),
    (_SERVER, f"{_CONTAINER}.resources.limits", _GONE, "all memory"),
    (_SERVER, f"{_CONTAINER}.args.4", "--log-formats=json", "log-formats"),
    (_SERVER, f"{_CONTAINER}.args.5", "--drain-seconds=soon", "drain-seconds"),
    (_WORKERS, f"{_CONTAINER}.args.0", "--manifold=tours", "tours"),
    (_WORKERS, f"{_CONTAINER}.args.2", "--all-serves", "--all-serves"),
]


def put(item: dict[str, Any], path: str, value: Any) -> None:
    """Changes what is at the end of a path, or takes it away."""
    *way, last = (int(step) if step.isdigit() else step for step in path.split("."))
    for step in way:
        item = item[step]
    if value is _GONE:
        del item[last]
    else:
        item[last] = value


class Kubernetes(unittest.TestCase):
    def test_nothing_is_wrong(self) -> None:
        self.assertEqual(manifests.problems(manifests.load()), [])

    def test_every_mistake_is_seen(self) -> None:
        for where, path, value, word in MISTAKES:
            with self.subTest(where=where[1], path=path, value=value):
                objects = copy.deepcopy(manifests.load())  # aliases of YAML are shared
                objects = {key: copy.deepcopy(item) for key, item in objects.items()}
                put(objects[where], path, value)
                self.assertIn(word, "\n".join(manifests.problems(objects)))

    def test_what_is_missing_is_seen(self) -> None:
        for gone in (_BUDGET, _SERVICE):
            objects = manifests.load()
            del objects[gone]
            self.assertNotEqual(manifests.problems(objects), [], gone)


class ServerOfTheManifest(unittest.TestCase):
    """The real program with the manifest's arguments, but for its ports and its directory."""

    def test_it_starts_and_answers_its_probes(self) -> None:
        item = manifests.load()[_SERVER]
        with tempfile.TemporaryDirectory() as folder:
            ready = pathlib.Path(folder) / "ready"
            moved = {
                "--listen": "127.0.0.1:0",
                "--metrics-listen": "127.0.0.1:0",
                "--data-dir": folder + manifests.arguments_of(item)["--data-dir"],
                "--ready-file": str(ready),
            }
            arguments = {**manifests.arguments_of(item), **moved}
            given = [f"{flag}={value}" if value else flag for flag, value in arguments.items()]
            server = subprocess.Popen(
                [os.environ["STELLATED"], *given], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
            )
            try:
                while not ready.exists():
                    self.assertIsNone(server.poll(), "it does not start")
                    time.sleep(0.01)
                address = ready.read_text().strip()
                container = manifests.container_of(item)
                for probe in ("startupProbe", "readinessProbe"):
                    service = container[probe]["grpc"].get("service", "")
                    self.assertEqual(self.ask(address, service), 0, probe)
                self.assertEqual(self.ask(address, "stellate.v1.Stelate"), 1, "asked of nothing")
            finally:
                server.terminate()
                _, log = server.communicate(timeout=_PATIENCE)
            self.assertEqual(server.returncode, 0, log)

    def ask(self, address: str, service: str) -> int:
        """What a probe would be told: 0 is serving."""
        command = [os.environ["STELLATED"], "--health-check", "--listen", address]
        return subprocess.run(
            [*command, "--health-service", service], capture_output=True, timeout=_PATIENCE
        ).returncode


class Compose(unittest.TestCase):
    def setUp(self) -> None:
        checked = subprocess.run(
            ["docker-compose", "-f", str(COMPOSE), "config"], capture_output=True, text=True
        )
        self.assertEqual(checked.returncode, 0, checked.stderr)
        self.services = yaml.safe_load(checked.stdout)["services"]

    def test_services(self) -> None:
        workers = [name for name in self.services if name.startswith("worker")]
        self.assertEqual(len(workers), 2)
        self.assertEqual(set(self.services), {"stellated", "prometheus", *workers})
        for name, service in self.services.items():
            self.assertTrue(service["read_only"], name)
            self.assertEqual(service["cap_drop"], ["ALL"], name)
            for port in service.get("ports", []):
                host = port if isinstance(port, str) else port.get("host_ip", "")
                self.assertTrue(host.startswith("127.0.0.1"), f"{name} publishes {port}")

    def test_flags_exist(self) -> None:
        given = manifests.flags_in(self.services["stellated"]["command"])
        known = manifests.flags_of([os.environ["STELLATED"]])
        self.assertTrue(given and given <= known, given - known)
        known = manifests.flags_of(manifests.WORKER)
        for name in ("worker-1", "worker-2"):
            given = manifests.flags_in(self.services[name]["command"])
            self.assertTrue(given and given <= known, given - known)

    def test_stages_exist(self) -> None:
        stages = re.findall(r"^FROM \S+ AS (\S+)", (ROOT / "docker/Dockerfile").read_text(), re.M)
        for service in self.services.values():
            self.assertIn(service.get("build", {}).get("target", "build"), stages)

    def test_prometheus_scrapes_the_server(self) -> None:
        scraped = yaml.safe_load((ROOT / "docker" / "prometheus.yml").read_text())
        targets = scraped["scrape_configs"][0]["static_configs"][0]["targets"]
        host, port = targets[0].split(":")
        command = dict(a.split("=") for a in self.services[host]["command"] if "=" in a)
        self.assertEqual(command["--metrics-listen"].rsplit(":", 1)[1], port)
        mounted = [v for v in self.services["prometheus"]["volumes"] if "prometheus.yml" in str(v)]
        self.assertEqual(len(mounted), 1)


if __name__ == "__main__":
    unittest.main()
