"""Renders docker/helm/stellate with helm.

Where its user says nothing it is docker/kubernetes, object by object; whatever its values are, what
manifests.py knows of manifests holds, the server takes its arguments and HAProxy its configuration.
"""

from __future__ import annotations

import copy
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest
from typing import Any

import chart_test
import kubernetes_objects
import manifests
import monitor
import yaml
from chart_test import CHART
from kubernetes_objects import ROOT, Object, Objects, arguments_of, container_of, pod_of

HAPROXY = shutil.which("haproxy", path=os.environ.get("PATH", "") + ":/usr/sbin") or "haproxy"
_OF_HELM = {
    "helm.sh/chart", "app.kubernetes.io/managed-by", "app.kubernetes.io/instance", "app.kubernetes.io/version",
}  # fmt: skip
_SERVER, _PROXY, _WORKER = (
    ("StatefulSet", "stellated"),
    ("Deployment", "proxy"),
    ("Deployment", "oracle-torus"),
)
_POLICY = ("NetworkPolicy", "stellated")
_DIGEST = "sha256:" + "0123456789abcdef" * 4


class Rendering:
    """What helm makes of some values."""

    def __init__(self, output: str) -> None:
        self.monitors: list[Object] = []
        self.objects: Objects = {}
        for item in filter(None, yaml.safe_load_all(output)):
            if item["kind"] == "ServiceMonitor":
                self.monitors.append(item)
            else:
                self.objects[item["kind"], item["metadata"]["name"]] = item

    def __getitem__(self, where: tuple[str, str]) -> Object:
        return self.objects[where]


def plain(item: Object) -> Object:
    """An object without what helm adds to it, its image by its name alone, as kustomize has them."""
    item = copy.deepcopy(item)
    kept = {k: v for k, v in item["metadata"].get("labels", {}).items() if k not in _OF_HELM}
    item["metadata"].pop("labels", None)
    if kept:
        item["metadata"]["labels"] = kept
    if item["kind"] in ("StatefulSet", "Deployment"):
        container_of(item)["image"] = container_of(item)["image"].split(":")[0].split("@")[0]
        annotations = item["spec"]["template"]["metadata"].get("annotations", {})
        if annotations.pop("checksum/configuration", None) and not annotations:
            del item["spec"]["template"]["metadata"]["annotations"]
    return item


class Helm(unittest.TestCase):
    helm: str

    @classmethod
    def setUpClass(cls) -> None:
        program = pathlib.Path(__file__).resolve().parent / "helm_program"
        cls.helm = subprocess.run(
            [program], check=True, stdout=subprocess.PIPE, text=True
        ).stdout.strip()

    def run_helm(
        self, *arguments: Any, values: Object | None = None
    ) -> subprocess.CompletedProcess[str]:
        with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
            yaml.safe_dump(values or {}, file)
            file.flush()
            return subprocess.run(
                [self.helm, *map(str, arguments), "--values", file.name, "--kube-version", "1.31.0"],
                capture_output=True, text=True,
            )  # fmt: skip

    def render(self, **values: Any) -> Rendering:
        """Also by helm's linter, which reads the notes too."""
        done = self.run_helm("lint", "--strict", CHART, values=values)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        done = self.run_helm(
            "template", "stellate", CHART, "--namespace", "stellate", values=values
        )
        self.assertEqual(done.returncode, 0, done.stderr)
        return Rendering(done.stdout)

    def problems(self, rendering: Rendering, *without: str) -> list[str]:
        """What manifests.py says of it, in the namespace that its user makes."""
        namespace = kubernetes_objects.load()["Namespace", "stellate"]
        plainly = {where: plain(item) for where, item in rendering.objects.items()}
        return manifests.problems({("Namespace", "stellate"): namespace, **plainly}, without)

    def assert_haproxy_takes(self, rendering: Rendering) -> None:
        """Its own check, with the names of servers that this machine knows, and certificates."""
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run(
                [ROOT / "docker" / "make-secrets", folder], check=True, capture_output=True
            )
            text = kubernetes_objects.balancer(rendering.objects)
            text = text.replace("/etc/stellate", folder).replace("user ", "# user ")
            (pathlib.Path(folder) / "haproxy.cfg").write_text(text)
            given = {e["name"]: e["value"] for e in container_of(rendering[_PROXY])["env"]}
            done = subprocess.run(
                [HAPROXY, "-c", "-f", f"{folder}/haproxy.cfg"], env={**os.environ, **given},
                capture_output=True, text=True,
            )  # fmt: skip
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)

    def test_as_it_is_it_is_the_manifests(self) -> None:
        rendering = self.render()
        self.assertEqual(rendering.monitors, [])
        made = {where: plain(item) for where, item in rendering.objects.items()}
        configuration = made.pop(("ConfigMap", "proxy"))
        self.assertEqual(
            configuration["data"]["haproxy.cfg"],
            (kubernetes_objects.MANIFESTS / "haproxy.cfg").read_text(),
        )
        wanted = kubernetes_objects.load()
        del wanted["Namespace", "stellate"]
        self.assertEqual(set(made), set(wanted))
        for where, item in wanted.items():
            with self.subTest(where):
                self.assertEqual(made[where], item)
        tags = {
            image["name"]: image["newTag"] for image in kubernetes_objects.kustomization()["images"]
        }
        for item in kubernetes_objects.workloads(rendering.objects).values():
            name, tag = container_of(item)["image"].split(":")
            self.assertEqual(tag, tags[name])
        self.assertEqual(self.problems(rendering), [])
        self.assert_haproxy_takes(rendering)

    def test_three_servers_are_reached(self) -> None:
        rendering = self.render(server={"replicas": 3, "drainSeconds": 60})
        self.assertEqual(self.problems(rendering), [])
        self.assert_haproxy_takes(rendering)
        self.assertIn(
            'server stellated-2 "${STELLATED_2}"', kubernetes_objects.balancer(rendering.objects)
        )

    def test_one_of_each(self) -> None:
        """No budget, which could only keep a node from being emptied."""
        worker = {**chart_test.values()["workers"][0], "minReplicas": 1, "maxReplicas": 1}
        rendering = self.render(server={"replicas": 1}, proxy={"replicas": 1}, workers=[worker])
        self.assertEqual(self.problems(rendering), [])
        self.assertEqual(
            [name for kind, name in rendering.objects if kind == "PodDisruptionBudget"], []
        )
        self.assertEqual(rendering[_WORKER]["spec"]["replicas"], 1)
        self.assertNotIn(("HorizontalPodAutoscaler", "oracle-torus"), rendering.objects)
        self.assert_haproxy_takes(rendering)

    def test_settings_are_what_the_server_reads(self) -> None:
        settings = {
            "max-memory-bytes": 68719476736,
            "check-share": 0.05,
            "log-level": "debug",
            "owner-meshes": 7,
        }
        rendering = self.render(server={"settings": settings})
        self.assertEqual(self.problems(rendering, "_programs"), [])
        self.assertEqual(arguments_of(rendering[_SERVER])["--config"], "/etc/stellated/settings")
        with tempfile.NamedTemporaryFile("w") as file:
            file.write(rendering["ConfigMap", "stellated"]["data"]["settings"])
            file.flush()
            given = [
                f"{k}={v}" for k, v in arguments_of(rendering[_SERVER]).items() if k != "--config"
            ]
            done = subprocess.run(
                [os.environ["STELLATED"], *given, f"--config={file.name}", "--print-config"],
                capture_output=True, text=True,
            )  # fmt: skip
        self.assertEqual(done.returncode, 0, done.stderr)
        read = dict(line.split(" = ") for line in done.stdout.splitlines() if " = " in line)
        shown = {key: yaml.safe_load(read[key]) for key in settings}
        self.assertEqual(shown, settings)

    def test_variables_of_the_environment(self) -> None:
        key = {"secretKeyRef": {"name": "otel", "key": "headers"}}
        variables = [{"name": "OTEL_EXPORTER_OTLP_HEADERS", "valueFrom": key}]
        for kind, before in (("volume", 0), ("database", 1)):
            rendering = self.render(server={"env": variables}, storage={"kind": kind})
            self.assertEqual(container_of(rendering[_SERVER])["env"][before:], variables)
        self.assertNotIn("env", container_of(self.render()[_SERVER]))

    def test_meshes_in_a_database(self) -> None:
        at = [{"ipBlock": {"cidr": "10.1.2.3/32"}}]
        rendering = self.render(storage={"kind": "database", "database": {"port": 6432, "at": at}})
        self.assertEqual(self.problems(rendering, "_volumes"), [])
        server = rendering[_SERVER]
        self.assertNotIn("volumeClaimTemplates", server["spec"])
        given = arguments_of(server)
        self.assertNotIn("--data-dir", given)
        self.assertEqual(given["--database"], "/etc/stellate/database")
        self.assertEqual(given["--peer-address"], "$(POD).stellated:7717")
        items = pod_of(server)["volumes"][0]["secret"]["items"]
        self.assertIn({"key": "database", "path": "database"}, items)
        ways = rendering[_POLICY]["spec"]["egress"]
        self.assertIn({"to": at, "ports": [{"port": 6432}]}, ways)
        self.assertIn("Egress", rendering[_POLICY]["spec"]["policyTypes"])
        env = {e["name"]: e["value"] for e in container_of(rendering[_PROXY])["env"]}
        self.assertEqual(env["STELLATED_SHARE_DATABASE"], "1")
        self.assert_haproxy_takes(rendering)

    def test_meshes_in_memory(self) -> None:
        rendering = self.render(storage={"kind": "memory"})
        self.assertEqual(self.problems(rendering, "_volumes"), [])
        self.assertFalse({"--data-dir", "--database"} & set(arguments_of(rendering[_SERVER])))
        self.assertEqual([v["name"] for v in pod_of(rendering[_SERVER])["volumes"]], ["secrets"])

    def test_volumes_of_a_class(self) -> None:
        rendering = self.render(storage={"className": "fast", "size": "1Ti"})
        self.assertEqual(self.problems(rendering), [])
        claim = rendering[_SERVER]["spec"]["volumeClaimTemplates"][0]["spec"]
        self.assertEqual(claim["storageClassName"], "fast")
        self.assertEqual(claim["resources"]["requests"]["storage"], "1Ti")

    def test_files_of_other_secrets(self) -> None:
        files = {
            "server.pem": {"secret": "mesh-tls", "key": "tls.crt"},
            "tokens": {"secret": "owners"},
        }
        rendering = self.render(secrets={"name": "own", "files": files})
        self.assertEqual(self.problems(rendering), [])
        sources = pod_of(rendering[_SERVER])["volumes"][0]["projected"]["sources"]
        found = {
            i["path"]: (s["secret"]["name"], i["key"])
            for s in sources
            for i in s["secret"]["items"]
        }
        wanted = {
            "server.pem": ("mesh-tls", "tls.crt"), "server.key": ("own", "server.key"), "tokens": ("owners", "tokens"),
        }  # fmt: skip
        self.assertEqual(found, wanted)

    def test_a_monitor_finds_the_metrics(self) -> None:
        rendering = self.render(
            metrics={"serviceMonitor": {"enabled": True, "labels": {"release": "prometheus"}}}
        )
        (made,) = rendering.monitors
        self.assertEqual(monitor.problems(made, rendering.objects), [])
        self.assertEqual(made["metadata"]["labels"]["release"], "prometheus")
        self.assertEqual(made["spec"], monitor.load()["spec"])

    def test_without_a_proxy(self) -> None:
        rendering = self.render(proxy={"enabled": False})
        left_out = {"_ports", "ways_in", "policies"}  # they are about the proxy
        self.assertEqual(self.problems(rendering, *left_out), [])
        self.assertFalse([name for _, name in rendering.objects if name == "proxy"])
        self.assertEqual(arguments_of(rendering[_WORKER])["--server"], "stellated:7717")
        self.assertIn({"ports": [{"port": "grpc"}]}, rendering[_POLICY]["spec"]["ingress"])

    def test_whose_clients_may_come(self) -> None:
        lab = {"namespaceSelector": {"matchLabels": {"kubernetes.io/metadata.name": "lab"}}}
        rendering = self.render(
            networkPolicy={"clients": [lab]}, proxy={"service": {"type": "LoadBalancer"}}
        )
        self.assertEqual(self.problems(rendering), [])
        (way,) = rendering["NetworkPolicy", "proxy"]["spec"]["ingress"]
        oracles = {"podSelector": {"matchLabels": {"app.kubernetes.io/component": "oracle"}}}
        self.assertEqual(way["from"], [lab, oracles])
        self.assertEqual(rendering["Service", "proxy"]["spec"]["type"], "LoadBalancer")

    def test_workers_of_another_image(self) -> None:
        worker = chart_test.values()["workers"][0]
        own = {
            **worker,
            "name": "brain",
            "image": {"repository": "lab/brain", "tag": "7"},
            "args": ["--fast"],
        }
        rendering = self.render(workers=[worker, own])
        self.assertEqual(self.problems(rendering, "_placement"), [])
        made = container_of(rendering["Deployment", "oracle-brain"])
        self.assertEqual((made["image"], made["args"]), ("lab/brain:7", ["--fast"]))
        self.assertEqual(self.problems(self.render(workers=[]), "_programs"), [])

    def test_images_by_their_digest(self) -> None:
        rendering = self.render(
            images={
                "server": {"repository": "registry.lab/stellate", "digest": _DIGEST},
                "pullPolicy": "Always", "pullSecrets": ["registry"],
            },
            nodeSelector={"disk": "ssd"}, tolerations=[{"key": "mesh", "operator": "Exists"}],
        )  # fmt: skip
        self.assertEqual(
            container_of(rendering[_SERVER])["image"], f"registry.lab/stellate@{_DIGEST}"
        )
        for item in kubernetes_objects.workloads(rendering.objects).values():
            self.assertEqual(container_of(item)["imagePullPolicy"], "Always")
            self.assertEqual(pod_of(item)["imagePullSecrets"], [{"name": "registry"}])
            self.assertEqual(pod_of(item)["nodeSelector"], {"disk": "ssd"})
            self.assertEqual(pod_of(item)["tolerations"][0]["key"], "mesh")
        self.assertEqual(self.problems(rendering, "_placement"), [])

    def test_what_the_docs_show(self) -> None:
        rendering = self.render(**chart_test.documented())
        self.assertEqual(self.problems(rendering, "_placement", "_volumes", "_programs"), [])
        self.assertEqual(rendering[_SERVER]["spec"]["replicas"], 3)

    def test_another_namespace(self) -> None:
        done = self.run_helm("template", "mine", CHART, "--namespace", "lab")
        self.assertEqual(done.returncode, 0, done.stderr)
        rendering = Rendering(done.stdout)
        self.assertEqual(
            {item["metadata"]["namespace"] for item in rendering.objects.values()}, {"lab"}
        )
        names = [e["value"] for e in container_of(rendering[_PROXY])["env"]]
        self.assertIn("stellated-0.stellated.lab.svc.cluster.local:7717", names)

    def test_wrong_values_are_refused(self) -> None:
        for path, value, _ in chart_test.REFUSED:
            with self.subTest(path=path, value=value):
                values: Object = {}
                place = values
                *way, last = path.split(".")
                for step in way:
                    place = place.setdefault(step, {})
                place[last] = value
                done = self.run_helm("template", "stellate", CHART, values=values)
                self.assertNotEqual(done.returncode, 0)
                self.assertIn("values don't meet the specifications of the schema", done.stderr)

    def test_it_packs_whole(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            command = [self.helm, "package", str(CHART), "--destination", folder]
            subprocess.run(command, check=True, capture_output=True)
            (packed,) = pathlib.Path(folder).iterdir()
            done = self.run_helm("template", "stellate", packed, "--namespace", "stellate")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(Rendering(done.stdout).objects, self.render().objects)


if __name__ == "__main__":
    sys.exit(unittest.main())
