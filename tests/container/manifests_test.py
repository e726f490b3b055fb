"""Holds docker/'s Kubernetes manifests to what they are made for.

Each rule of manifests.py is shown to see mistakes: of every kind that it is there for, one is made
in a copy of the manifests.
"""

from __future__ import annotations

import copy
import json
import os
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import unittest
from typing import Any

import kubernetes_objects
import manifests
import monitor
from kubernetes_objects import ROOT

sys.path.insert(0, str(ROOT / "clients" / "python"))

import stellate  # noqa: E402

_PATIENCE = 60.0  # seconds: for a hang, not for a measurement

_SERVER, _WORKERS = ("StatefulSet", "stellated"), ("Deployment", "oracle-torus")
_SERVICE, _SCALER = ("Service", "stellated"), ("HorizontalPodAutoscaler", "oracle-torus")
_PROXY, _CLOSED = ("Deployment", "proxy"), ("NetworkPolicy", "nobody")
_POLICY = ("NetworkPolicy", "stellated")
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
    (_SERVER, f"{_CONTAINER}.readinessProbe.exec.command", "stellated-health", "has to be a list"),
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
    (_SERVER, f"{_CONTAINER}.readinessProbe.exec.command.1", "--health-service=alive", "readiness"),
    (_SERVER, f"{_CONTAINER}.startupProbe.exec.command.0", "stellated", "startupProbe asks"),
    (_PROXY, f"{_CONTAINER}.livenessProbe.tcpSocket.port", "gprc", "livenessProbe asks port gprc"),
    (_SERVER, f"{_CONTAINER}.livenessProbe", _GONE, "livenessProbe asks []"),
    (_SERVER, f"{_CONTAINER}.ports.0.containerPort", 7000, "--listen="),
    (_SERVER, f"{_CONTAINER}.args.5", "--metrics-listen=0.0.0.0:9000", "--metrics-listen="),
    (_SERVER, "spec.template.metadata.annotations", {"prometheus.io/port": "80"}, "port 80"),
    (_SERVER, "spec.serviceName", "stellate", "no headless Service"),
    (_SERVICE, "spec.clusterIP", _GONE, "no headless Service"),
    (_SERVICE, "spec.ports.0.targetPort", "gprc", "leads to port gprc"),
    (_WORKERS, f"{_CONTAINER}.args.1", "--server=stellated:7717", "looks for a server"),
    (_SERVER, f"{_CONTAINER}.volumeMounts.0.name", "data", "mounts ['data', 'secrets']"),
    (_SERVER, f"{_CONTAINER}.volumeMounts.0.mountPath", "/var/lib/stellated", "in no volume"),
    (_SERVER, "spec.volumeClaimTemplates.0.spec.accessModes", ["ReadWriteMany"], "cannot share"),
    (_SERVER, "spec.template.spec.terminationGracePeriodSeconds", 30, "are killed after 30"),
    (_SERVER, f"{_CONTAINER}.args.7", "--drain-seconds=60", "drain for 60"),
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
    (_SERVER, f"{_CONTAINER}.args.6", "--log-formats=json", "log-formats"),
    (_SERVER, f"{_CONTAINER}.args.7", "--drain-seconds=soon", "drain-seconds"),
    (_WORKERS, f"{_CONTAINER}.args.0", "--manifold=tours", "tours"),
    (_WORKERS, f"{_CONTAINER}.args.2", "--tls-cas=/etc/stellate/ca.pem", "--tls-cas"),
    (_SERVER, f"{_CONTAINER}.args.1", "--insecure-listen", "no --tls-cert"),
    (
        _SERVER,
        f"{_CONTAINER}.args.3",
        "--token-file=/etc/stellate/token",
        "token, which is not mounted",
    ),
    (_WORKERS, f"{_CONTAINER}.args.3", "--epsilon=0.1", "no --token-file"),
    (_SERVER, "spec.template.spec.volumes.0.secret.items.0.key", "tls.crt", "makes no tls.crt"),
    (_SERVER, "spec.replicas", 3, "servers are"),
    (_PROXY, f"{_CONTAINER}.env.0.value", "stellated:7717", "the proxy leads to"),
    (_PROXY, "spec.template.spec.volumes.0.configMap.name", "haproxy", "no ConfigMap"),
    (_SERVICE, "spec.publishNotReadyAddresses", _GONE, "loses the names"),
    (_CLOSED, "spec.policyTypes", ["Ingress"], "closes the namespace"),
    (
        _POLICY,
        "spec.podSelector.matchLabels",
        {"app": "x"},
        "0 NetworkPolicies are about stellated",
    ),
    (_POLICY, "spec.ingress.0.ports.0.port", "gprc", "let in to at port gprc"),
    (_POLICY, "spec.ingress.0", {"ports": [{"port": "grpc"}]}, "may be called by"),
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
        self.assertEqual(manifests.problems(kubernetes_objects.load()), [])

    def test_every_mistake_is_seen(self) -> None:
        for where, path, value, word in MISTAKES:
            with self.subTest(where=where[1], path=path, value=value):
                objects = copy.deepcopy(kubernetes_objects.load())  # aliases of YAML are shared
                objects = {key: copy.deepcopy(item) for key, item in objects.items()}
                put(objects[where], path, value)
                self.assertIn(word, "\n".join(manifests.problems(objects)))

    def test_what_is_missing_is_seen(self) -> None:
        for gone in (_BUDGET, _SERVICE):
            objects = kubernetes_objects.load()
            del objects[gone]
            self.assertNotEqual(manifests.problems(objects), [], gone)


class Monitor(unittest.TestCase):
    def test_nothing_is_wrong(self) -> None:
        self.assertEqual(monitor.problems(monitor.load(), kubernetes_objects.load()), [])

    def test_every_mistake_is_seen(self) -> None:
        mistakes: list[tuple[str, Any, str]] = [
            ("apiVersion", "monitoring.coreos.com/v2", "no ServiceMonitor"),
            ("kind", "PodMonitor", "no ServiceMonitor"),
            ("metadata.namespace", "default", "lets in ['monitoring'] alone"),
            ("spec.namespaceSelector.matchNames", ["default"], "chooses the Services []"),
            ("spec.selector.matchLabels", {"app": "stellated"}, "chooses the Services []"),
            ("spec.selector", {}, "chooses the Services ["),
            ("spec.endpoints", _GONE, "reads the port None"),
            ("spec.endpoints.0.port", "grpc", "reads the port grpc"),
            ("spec.endpoints.0.port", 9717, "reads the port 9717"),
            ("spec.endpoints.0.path", "/", "no metrics at /"),
            ("spec.endpoints.0.interval", 15, "no interval"),
            ("spec.endpoints.0.intervall", "15s", "no such field: intervall"),
            ("spec.endpionts", [], "no such field: endpionts"),
        ]
        for path, value, word in mistakes:
            with self.subTest(path=path, value=value):
                changed = monitor.load()
                put(changed, path, value)
                found = monitor.problems(changed, kubernetes_objects.load())
                self.assertIn(word, "\n".join(found))


class ServerOfTheManifest(unittest.TestCase):
    """The real program with the manifest's arguments, except its ports and its directories."""

    def setUp(self) -> None:
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = pathlib.Path(scratch.name)
        make_secrets = ROOT / "docker" / "make-secrets"
        subprocess.run([make_secrets, self.folder / "secrets"], check=True, capture_output=True)
        # A program of its own, as the health check goes by it: others' servers run here, too.
        (self.folder / "bin").mkdir()
        shutil.copy(os.environ["STELLATED"], self.folder / "bin" / "stellated")
        shutil.copy(ROOT / "docker" / "stellated-health", self.folder / "bin")
        self.environment = {**os.environ, "PATH": f"{self.folder}/bin:{os.environ['PATH']}"}

    def start(self, arguments: dict[str, str]) -> None:
        ready = self.folder / "ready"
        given = [f"{flag}={value}" if value else flag for flag, value in arguments.items()]
        self.server = subprocess.Popen(
            ["stellated", *given, f"--ready-file={ready}"], env=self.environment,
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        )  # fmt: skip
        self.addCleanup(self.server.communicate)
        self.addCleanup(self.server.kill)
        while not ready.exists():
            self.assertIsNone(self.server.poll(), "it does not start")
            time.sleep(0.01)
        self.address = ready.read_text().strip()

    def test_it_starts_and_answers_its_probes(self) -> None:
        item = kubernetes_objects.load()[_SERVER]
        arguments = kubernetes_objects.arguments_of(item)
        with socket.socket() as free:  # the health check goes by --listen
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.start({
            **{flag: value.replace("/etc/stellate", f"{self.folder}/secrets")
               for flag, value in arguments.items()},
            "--listen": f"0.0.0.0:{port}",
            "--metrics-listen": "127.0.0.1:0",
            "--data-dir": f"{self.folder}{arguments['--data-dir']}",
        })  # fmt: skip
        container = kubernetes_objects.container_of(item)
        for probe in ("startupProbe", "readinessProbe", "livenessProbe"):
            self.assertEqual(self.ask(*container[probe]["exec"]["command"]), 0, probe)
        self.assertEqual(self.ask("stellated-health", "--health-service=nothing"), 1)
        self.assertIn(
            "HEALTHCHECK", (ROOT / "docker/Dockerfile").read_text(), "the image asks the same way"
        )
        # Without a token, or in plain text, nobody gets in.
        client = stellate.Credentials(ca=str(self.folder / "secrets" / "ca.pem"))
        token = (self.folder / "secrets" / "me.token").read_text().strip()
        for credentials, error in (
            (None, stellate.Unavailable),
            (client, stellate.Unauthenticated),
        ):
            with stellate.Client(f"localhost:{port}", credentials) as stranger:
                self.assertRaises(error, stranger.info)
        with stellate.Client(
            f"localhost:{port}", stellate.Credentials(ca=client.ca, token=token)
        ) as friend:
            self.assertEqual(friend.info().version, manifests.version())
        self.server.terminate()
        _, log = self.server.communicate(timeout=_PATIENCE)
        self.assertEqual(self.server.returncode, 0, log)
        self.assertEqual(self.ask("stellated-health"), 1, "no server is no health")

    def test_alone_the_image_listens_on_its_loopback(self) -> None:
        text = (ROOT / "docker/Dockerfile").read_text()
        (command,) = re.findall(r"^ENTRYPOINT \[\"stellated\"\]\nCMD (\[.*\])$", text, re.M)
        self.assertEqual(json.loads(command), ["--listen", "127.0.0.1:7717"])
        self.assertNotIn("--insecure-listen", text)

    def ask(self, *command: str) -> int:
        """What a probe would be told: 0 is serving."""
        return subprocess.run(
            command, env=self.environment, capture_output=True, timeout=_PATIENCE
        ).returncode


if __name__ == "__main__":
    unittest.main()
