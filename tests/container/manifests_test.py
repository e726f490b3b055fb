"""Holds docker/'s compose file and Kubernetes manifests to what they are made for.

Kubernetes' own Python client says which fields its objects have and of which types; docker-compose
checks the compose file; the servers' and the workers' own --help says which flags there are.
"""

from __future__ import annotations

import functools
import os
import pathlib
import re
import subprocess
import sys
import unittest
from typing import Any, Iterator

import yaml
from kubernetes.client import models

ROOT = pathlib.Path(__file__).resolve().parents[2]
MANIFESTS = ROOT / "docker" / "kubernetes"
COMPOSE = ROOT / "docker" / "compose.yaml"

# Newer than Debian's client, which knows the first by its name before that.
_MODELS = {("autoscaling/v2", "HorizontalPodAutoscaler"): "V2beta2HorizontalPodAutoscaler"}
_NEWER_FIELDS = {"V1Probe": {"grpc": {"port": int, "service": str}}}
_GROUPS = ("apps/", "policy/", "autoscaling/")


def objects() -> dict[tuple[str, str], dict[str, Any]]:
    """All of them, by kind and name."""
    found = {}
    for resource in yaml.safe_load((MANIFESTS / "kustomization.yaml").read_text())["resources"]:
        for item in yaml.safe_load_all((MANIFESTS / resource).read_text()):
            found[item["kind"], item["metadata"]["name"]] = item
    return found


def misfits(value: Any, kind: str, path: str) -> Iterator[str]:
    """Where `value` is not what Kubernetes calls `kind`: unknown fields, missing ones, types."""
    if listed := re.fullmatch(r"list\[(.+)\]", kind):
        if not isinstance(value, list):
            yield f"{path} has to be a list"
            return
        for number, element in enumerate(value):
            yield from misfits(element, listed[1], f"{path}[{number}]")
    elif mapped := re.fullmatch(r"dict\(str, (.+)\)", kind):
        if not isinstance(value, dict):
            yield f"{path} has to be a mapping"
            return
        for key, element in value.items():
            yield from misfits(element, mapped[1], f"{path}.{key}")
    elif kind in ("str", "int", "bool"):
        if type(value).__name__ != kind:
            yield f"{path} has to be {kind}, and is {value!r}"
    elif kind == "object":  # a number or a name, as of a port
        if not isinstance(value, (int, str)):
            yield f"{path} has to be a number or a name"
    else:
        yield from _object_misfits(value, kind, path)


def _object_misfits(value: Any, kind: str, path: str) -> Iterator[str]:
    if not isinstance(value, dict):
        yield f"{path} has to be a {kind}"
        return
    model = getattr(models, kind)
    fields = {model.attribute_map[name]: t for name, t in model.openapi_types.items()}
    newer = _NEWER_FIELDS.get(kind, {})
    for key, element in value.items():
        if key in newer:
            for inner, content in element.items():
                if not isinstance(content, newer[key].get(inner, ())):
                    yield f"{path}.{key}.{inner} is no field, or of the wrong type"
        elif key not in fields:
            yield f"{path}.{key}: {kind} has no such field"
        else:
            yield from misfits(element, fields[key], f"{path}.{key}")
    try:  # the constructor refuses objects that lack what they must have
        model(**{name: value.get(key) for name, key in model.attribute_map.items()})
    except ValueError as error:
        yield f"{path}: {error}"


@functools.cache
def flags_of(*command: str) -> set[str]:
    """What a program says it takes."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "clients" / "python")}
    said = subprocess.run(
        [*command, "--help"], capture_output=True, text=True, check=True, env=environment
    )
    return set(re.findall(r"--[a-z][a-z-]*", said.stdout))


def flags_in(arguments: list[str]) -> set[str]:
    """What it is given."""
    return {argument.split("=")[0] for argument in arguments if argument.startswith("--")}


def server_flags() -> set[str]:
    return flags_of(os.environ["STELLATED"])


def worker_flags() -> set[str]:
    return flags_of(sys.executable, "-B", str(ROOT / "docker" / "oracle_worker.py"))


class Kubernetes(unittest.TestCase):
    def setUp(self) -> None:
        self.objects = objects()
        self.server = self.objects["StatefulSet", "stellated"]
        self.workers = self.objects["Deployment", "oracle-torus"]

    def pod(self, item: dict[str, Any]) -> dict[str, Any]:
        return item["spec"]["template"]["spec"]

    def test_objects_are_what_kubernetes_takes(self) -> None:
        for (kind, name), item in self.objects.items():
            version = item["apiVersion"]
            self.assertTrue(version == "v1" or version.startswith(_GROUPS), version)
            model = _MODELS.get((version, kind), f"{version.split('/')[-1].capitalize()}{kind}")
            self.assertEqual(list(misfits(item, model, f"{kind}/{name}")), [])
            if kind != "Namespace":
                self.assertEqual(item["metadata"]["namespace"], "stellate")

    def test_the_checks_see_mistakes(self) -> None:
        container = self.pod(self.server)["containers"][0]
        container["livenesProbe"] = {}
        container["resources"]["requests"]["cpu"] = 1
        del container["name"]
        found = "\n".join(misfits(self.server, "V1StatefulSet", "it"))
        for words in ("livenesProbe", "requests.cpu has to be str", "name"):
            self.assertIn(words, found)

    def test_selectors_find_their_pods(self) -> None:
        for item in (self.server, self.workers):
            labels = item["spec"]["template"]["metadata"]["labels"]
            name = item["metadata"]["name"]
            budget = self.objects["PodDisruptionBudget", name]
            for spec in (item["spec"], budget["spec"]):
                wanted = spec["selector"]["matchLabels"]
                self.assertTrue(wanted and wanted.items() <= labels.items(), wanted)
        service = self.objects["Service", self.server["spec"]["serviceName"]]
        labels = self.server["spec"]["template"]["metadata"]["labels"]
        self.assertTrue(service["spec"]["selector"].items() <= labels.items())
        ports = {port["name"] for port in self.pod(self.server)["containers"][0]["ports"]}
        self.assertTrue({port["targetPort"] for port in service["spec"]["ports"]} <= ports)
        self.assertEqual(service["spec"]["clusterIP"], "None")
        target = self.objects["HorizontalPodAutoscaler", "oracle-torus"]["spec"]["scaleTargetRef"]
        self.assertIn((target["kind"], target["name"]), self.objects)
        self.assertNotIn("replicas", self.workers["spec"])  # the autoscaler's

    def test_pods_are_confined(self) -> None:
        for item in (self.server, self.workers):
            pod = self.pod(item)
            self.assertTrue(pod["securityContext"]["runAsNonRoot"])
            self.assertGreater(pod["securityContext"]["runAsUser"], 0)
            self.assertFalse(pod["automountServiceAccountToken"])
            for container in pod["containers"]:
                context = container["securityContext"]
                self.assertTrue(context["readOnlyRootFilesystem"])
                self.assertFalse(context["allowPrivilegeEscalation"])
                self.assertEqual(context["capabilities"]["drop"], ["ALL"])
                self.assertIn("memory", container["resources"]["limits"])
                self.assertIn("cpu", container["resources"]["requests"])

    def test_the_server_is_probed_and_keeps_its_meshes(self) -> None:
        container = self.pod(self.server)["containers"][0]
        grpc_port = next(p["containerPort"] for p in container["ports"] if p["name"] == "grpc")
        for probe in ("startupProbe", "readinessProbe"):
            self.assertEqual(container[probe]["grpc"]["port"], grpc_port)
        arguments = dict(a.split("=") for a in container["args"] if "=" in a)
        self.assertEqual(arguments["--listen"].rsplit(":", 1)[1], str(grpc_port))
        mounts = {mount["name"]: mount["mountPath"] for mount in container["volumeMounts"]}
        claims = [c["metadata"]["name"] for c in self.server["spec"]["volumeClaimTemplates"]]
        self.assertTrue(arguments["--data-dir"].startswith(mounts[claims[0]]))
        grace = self.pod(self.server)["terminationGracePeriodSeconds"]
        self.assertGreater(grace, float(arguments["--drain-seconds"]))

    def test_flags_exist(self) -> None:
        given = flags_in(self.pod(self.server)["containers"][0]["args"])
        self.assertTrue(given and given <= server_flags(), given - server_flags())
        given = flags_in(self.pod(self.workers)["containers"][0]["args"])
        self.assertTrue(given and given <= worker_flags(), given - worker_flags())


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
        given = flags_in(self.services["stellated"]["command"])
        self.assertTrue(given and given <= server_flags(), given - server_flags())
        for name in ("worker-1", "worker-2"):
            given = flags_in(self.services[name]["command"])
            self.assertTrue(given and given <= worker_flags(), given - worker_flags())

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
