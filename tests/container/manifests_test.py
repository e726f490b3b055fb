"""Holds docker/'s Kubernetes manifests and compose file to what they are made for.

Each rule of manifests.py is shown to see mistakes: of every kind that it is there for, one is made
in a copy of the manifests. docker-compose checks the compose file.
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
import urllib.parse
from typing import Any

import kubernetes_objects
import manifest_safety
import manifests
import monitor
import yaml
from kubernetes_objects import ROOT

sys.path.insert(0, str(ROOT / "clients" / "python"))

import stellate  # noqa: E402

COMPOSE = ROOT / "docker" / "compose.yaml"
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


def pinned_images() -> dict[str, str]:
    """As docker/pin would write them, with digests of nothing."""
    return {
        line.split()[0]: f"{line.split()[1]}@sha256:{'0' * 64}"
        for line in (ROOT / "docker/images.txt").read_text().splitlines()
        if line and not line.startswith("#")
    }


def composed(file: pathlib.Path) -> dict[str, Any]:
    """A compose file as docker-compose reads it."""
    checked = subprocess.run(
        ["docker-compose", "-f", file, "config"], capture_output=True, text=True,
        env={**os.environ, **pinned_images()},
    )  # fmt: skip
    assert checked.returncode == 0, checked.stderr
    return dict(yaml.safe_load(checked.stdout))


class Alone(unittest.TestCase):
    """The compose file of one server for this machine."""

    def setUp(self) -> None:
        self.all = composed(ROOT / "docker" / "alone.yaml")
        ((self.name, self.server),) = self.all["services"].items()

    def test_nobody_else_reaches_it_and_it_keeps_its_meshes(self) -> None:
        self.assertEqual(self.server["network_mode"], "host")
        self.assertNotIn("ports", self.server)
        given = dict(flag.split("=") for flag in self.server["command"])
        self.assertTrue(given["--listen"].startswith("127.0.0.1:"))
        (volume,) = self.server["volumes"]
        source, target = (
            volume.split(":")[:2]
            if isinstance(volume, str)
            else (volume["source"], volume["target"])
        )
        self.assertEqual(target, given["--data-dir"])
        self.assertIn(source, self.all["volumes"])
        known = manifests.flags_of([os.environ["STELLATED"]])
        self.assertLessEqual(set(given), known)

    def test_it_is_confined_and_of_this_version(self) -> None:
        self.assertTrue(self.server["read_only"])
        self.assertEqual(self.server["cap_drop"], ["ALL"])
        self.assertEqual(self.server["image"], f"stellate:{manifests.version()}")
        self.assertEqual(self.server["build"]["target"], "runtime")

    def test_a_server_with_its_arguments_starts(self) -> None:
        with tempfile.TemporaryDirectory() as scratch:
            given = dict(flag.split("=") for flag in self.server["command"])
            folder = f"{scratch}{given['--data-dir']}"
            with (
                stellate.Server("--data-dir", folder, listen="127.0.0.1:0") as server,
                stellate.Client(server) as client,
            ):
                self.assertEqual(client.info().version, manifests.version())


class Compose(unittest.TestCase):
    def setUp(self) -> None:
        self.images = set(pinned_images().values())
        self.services = composed(COMPOSE)["services"]

    def test_services(self) -> None:
        workers = [name for name in self.services if name.startswith("worker")]
        self.assertEqual(len(workers), 2)
        self.assertEqual(
            set(self.services), {"proxy", "stellated", "prometheus", "grafana", *workers}
        )
        for name, service in self.services.items():
            self.assertTrue(service["read_only"], name)
            self.assertEqual(service["cap_drop"], ["ALL"], name)
            for port in service.get("ports", []):
                host = port if isinstance(port, str) else port.get("host_ip", "")
                self.assertTrue(host.startswith("127.0.0.1"), f"{name} publishes {port}")
        self.assertNotIn("ports", self.services["stellated"], "the proxy is the way in")

    def test_images_are_of_versions(self) -> None:
        for name, service in self.services.items():
            ours = re.fullmatch(r"stellate(-worker)?:(.+)", service["image"])
            if ours:
                self.assertEqual(ours[2], manifests.version(), name)
            else:
                self.assertIn(service["image"], self.images, name)
        for file in (ROOT / "docker").rglob("*"):
            if file.is_file():
                self.assertNotIn(":latest", file.read_text(), file)

    def test_bases_are_pinned(self) -> None:
        """Nothing is built, nor started, from whatever a tag stands for on that day."""
        if (ROOT / "docker/.env").exists():
            subprocess.run([ROOT / "docker/pin", "--check"], check=True)
        text = (ROOT / "docker/Dockerfile").read_text()
        bases = set(re.findall(r"^FROM (\S+) AS", text, re.M))
        self.assertEqual(bases, {"${STELLATE_BASE}", "build"})
        self.assertIn("\nARG STELLATE_BASE\n", text, "it has no default")

    def test_secrets_are_made(self) -> None:
        made = manifest_safety.made_secrets()
        for name, service in self.services.items():
            for volume in service.get("volumes", []):
                source = volume if isinstance(volume, str) else volume.get("source", "")
                if "/secrets/" in source:
                    self.assertIn(source.split(":")[0].split("/")[-1], made, name)
        server = manifests.flags_in(self.services["stellated"]["command"])
        self.assertLessEqual({"--tls-cert", "--tls-key", "--token-file"}, server)
        self.assertNotIn("--insecure-listen", server)

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

    def test_the_proxy_leads_to_the_server(self) -> None:
        host, port = self.services["proxy"]["environment"]["STELLATED_0"].split(":")
        command = dict(a.split("=") for a in self.services[host]["command"] if "=" in a)
        self.assertEqual(command["--listen"].rsplit(":", 1)[1], port)

    def test_prometheus_scrapes_the_server(self) -> None:
        scraped = yaml.safe_load((ROOT / "docker/prometheus/prometheus.yml").read_text())
        targets = scraped["scrape_configs"][0]["static_configs"][0]["targets"]
        host, port = targets[0].split(":")
        command = dict(a.split("=") for a in self.services[host]["command"] if "=" in a)
        self.assertEqual(command["--metrics-listen"].rsplit(":", 1)[1], port)


class Failover(unittest.TestCase):
    """The compose file of two servers on one PostgreSQL. tests/postgres runs what it says."""

    def setUp(self) -> None:
        self.all = composed(ROOT / "docker" / "failover.yaml")
        self.services = self.all["services"]
        self.servers = {n: s for n, s in self.services.items() if n.startswith("stellated-")}

    def test_services_are_confined_and_of_versions(self) -> None:
        self.assertEqual(set(self.services), {"proxy", "database", *self.servers})
        for name, service in self.services.items():
            self.assertTrue(service["read_only"], name)
            self.assertEqual(service["cap_drop"], ["ALL"], name)
            self.assertNotEqual(service.get("user", "65532").split(":")[0], "root", name)
            if name in self.servers:
                self.assertEqual(service["image"], f"stellate:{manifests.version()}")
                self.assertEqual(service["build"]["target"], "runtime")
            else:
                self.assertIn(service["image"], pinned_images().values(), name)
        (port,) = self.services["proxy"]["ports"]
        self.assertTrue(port.startswith("127.0.0.1:"), port)
        for name in ("database", *self.servers):
            self.assertNotIn("ports", self.services[name], "the proxy is the way in")

    def test_the_image_has_what_servers_need(self) -> None:
        """It is built with libpq: the argument is the Dockerfile's, and means something there."""
        text = (ROOT / "docker/Dockerfile").read_text()
        for server in self.servers.values():
            given = server["build"]["args"]
            self.assertEqual(given["STELLATE_POSTGRES"], "ON")
            self.assertLessEqual(set(given), set(re.findall(r"^ARG (\w+)", text, re.M)))

    def test_servers_have_the_same_settings_and_each_a_name(self) -> None:
        first, *others = self.servers.values()
        self.assertTrue(others)
        known = manifests.flags_of([os.environ["STELLATED"]])
        self.assertLessEqual(manifests.flags_in(first["command"]), known)
        for name, server in self.servers.items():
            self.assertEqual(server["hostname"], name, "where others dial it")
            for field in ("command", "image", "volumes"):
                self.assertEqual(server[field], first[field], name)
        flags = manifests.flags_in(first["command"])
        self.assertLessEqual({"--tls-cert", "--tls-key", "--token-file"}, flags)
        self.assertFalse({"--data-dir", "--insecure-listen"} & flags)

    def test_servers_reach_the_database_and_nothing_else_does(self) -> None:
        database = self.services["database"]
        self.assertEqual(database["network_mode"], "none")
        self.assertEqual(database["command"][-1], "listen_addresses=")
        url = urllib.parse.urlsplit(given_to(self.servers["stellated-0"])["--database"])
        self.assertEqual(url.username, database["environment"]["POSTGRES_USER"])
        self.assertEqual(url.path, f"/{url.username}", "the image names its database so")
        self.assertFalse(url.hostname or url.password)
        (place,) = urllib.parse.parse_qs(url.query)["host"]
        sharing = {n for n, s in self.services.items() if f"socket:{place}:rw" in s["volumes"]}
        self.assertEqual(sharing, {"database", *self.servers})
        self.assertIn("records:/var/lib/postgresql/data:rw", database["volumes"])
        self.assertEqual(set(self.all["volumes"]), {"records", "socket"})

    def test_the_proxy_leads_to_all_servers(self) -> None:
        proxy = self.services["proxy"]
        led = {value for name, value in proxy["environment"].items() if name[-1].isdigit()}
        ports = {given_to(s)["--listen"].rsplit(":", 1)[1] for s in self.servers.values()}
        (port,) = ports
        self.assertEqual(led, {f"{name}:{port}" for name in self.servers})
        config = (ROOT / "docker/postgres/haproxy.cfg").read_text()
        self.assertIn(f"bind :{proxy['ports'][0].split('/')[0].rsplit(':', 1)[1]}\n", config)
        asked = set(re.findall(r"\bSTELLATED_\w+", config))
        self.assertEqual(set(proxy["environment"]), asked)
        self.assertIn("STELLATED_TLS", asked, "whether it lives is asked over TLS, too")

    def test_secrets_are_made(self) -> None:
        made = manifest_safety.made_secrets()
        for name, server in self.servers.items():
            secret = {v.split(":")[1] for v in server["volumes"] if "/secrets/" in v}
            files = {v for v in given_to(server).values() if v.startswith("/etc/stellate/")}
            self.assertEqual(secret, files, name)
            self.assertLessEqual({pathlib.PurePosixPath(file).name for file in files}, made)


def given_to(service: dict[str, Any]) -> dict[str, str]:
    """The flags of a service's command, with their values."""
    return dict(flag.split("=", 1) for flag in service["command"])


class Pins(unittest.TestCase):
    """docker/pin, with a registry that says what it is told to."""

    def setUp(self) -> None:
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = pathlib.Path(scratch.name)
        for name in ("pin", "images.txt"):
            shutil.copy(ROOT / "docker" / name, self.folder)

    def pin(self, *arguments: str, says: str = "") -> subprocess.CompletedProcess[str]:
        asked = self.folder / "skopeo"
        asked.write_text(f"#!/bin/sh\n{says}\n")
        asked.chmod(0o755)
        environment = {**os.environ, "PATH": f"{self.folder}:{os.environ['PATH']}"}
        return subprocess.run(
            [self.folder / "pin", *arguments], env=environment, capture_output=True, text=True
        )

    def test_it_records_what_the_registry_says(self) -> None:
        self.assertIn("nothing is pinned", self.pin("--check").stderr)
        done = self.pin(says="echo sha256:$(echo $4 | sha256sum | cut -d ' ' -f 1)")
        self.assertEqual(done.returncode, 0, done.stderr)
        lines = (self.folder / ".env").read_text().splitlines()
        self.assertEqual(self.pin("--check").returncode, 0)
        self.assertTrue(
            any(
                re.fullmatch(r"STELLATE_BASE=debian:bookworm-slim@sha256:[0-9a-f]{64}", x)
                for x in lines
            )
        )
        # Another tag is another image.
        text = (self.folder / "images.txt").read_text()
        (self.folder / "images.txt").write_text(text.replace("bookworm-slim", "trixie-slim"))
        self.assertIn("does not pin STELLATE_BASE", self.pin("--check").stderr)

    def test_it_invents_nothing(self) -> None:
        for says in ("exit 1", "echo sha256:abc", "echo"):
            done = self.pin(says=says)
            self.assertEqual(done.returncode, 1, says)
            self.assertFalse((self.folder / ".env").exists(), says)


def files_of(folder: pathlib.Path) -> dict[str, bytes]:
    """What `kubectl create secret generic --from-file` takes of a folder: its files, no folders."""
    return {file.name: file.read_bytes() for file in folder.iterdir() if file.is_file()}


def public_key(kind: str, *options: str, text: bytes) -> bytes:
    command = ["openssl", kind, *options]
    return subprocess.run(command, input=text, capture_output=True, check=True).stdout


class Secrets(unittest.TestCase):
    def test_what_is_there_is_kept_and_private(self) -> None:
        with tempfile.TemporaryDirectory() as scratch:
            folder = pathlib.Path(scratch) / "secrets"
            command = [ROOT / "docker/make-secrets", folder, "--name", "mesh.example.org", "ada"]
            subprocess.run(command, check=True, capture_output=True)
            before = files_of(folder)
            subprocess.run([*command, "ben"], check=True, capture_output=True)
            after = files_of(folder)
            self.assertEqual(after.keys() - before.keys(), {"ben.token"})
            self.assertEqual({n for n in before if before[n] != after[n]}, {"tokens"})
            self.assertEqual(folder.stat().st_mode & 0o077, 0, "nobody else gets into the folder")
            names = subprocess.run(
                ["openssl", "x509", "-in", folder / "proxy.pem", "-noout", "-ext", "subjectAltName"],
                capture_output=True, text=True,
            ).stdout  # fmt: skip
            self.assertIn("DNS:mesh.example.org", names)

    def test_what_goes_to_a_cluster_signs_nothing(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([ROOT / "docker/make-secrets", folder], check=True, capture_output=True)
            files = files_of(pathlib.Path(folder))
            keys = {name: text for name, text in files.items() if b"PRIVATE KEY" in text}
            self.assertEqual(keys.keys(), {"server.key", "proxy.pem"})
            signs = public_key("x509", "-noout", "-pubkey", text=files["ca.pem"])
            self.assertNotIn(signs, [public_key("pkey", "-pubout", text=k) for k in keys.values()])


if __name__ == "__main__":
    unittest.main()
