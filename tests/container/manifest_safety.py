"""Rules of docker/kubernetes: who may speak with whom, in what words, and with which secrets."""

from __future__ import annotations

import functools
import json
import pathlib
import re
import subprocess
import tempfile
from collections.abc import Iterator

from kubernetes_objects import (
    ROOT,
    Object,
    Objects,
    arguments_of,
    balancer,
    container_of,
    find,
    kustomization,
    pod_of,
    secrets_of,
    workloads,
)  # fmt: skip


def ways_in(objects: Objects) -> Iterator[str]:
    """Nothing is said in plain text, but metrics; the proxy leads to every server."""
    for name, item in workloads(objects).items():
        yield from _secrets(name, item, objects)
    server = objects["StatefulSet", "stellated"]
    for flag in ("--tls-cert", "--tls-key", "--token-file"):
        if flag not in arguments_of(server):
            yield f"the server has no {flag}"
    for name, item in workloads(objects).items():
        if "--insecure-listen" in arguments_of(item):
            yield f"{name} listens in plain text"
        for flag in ("--tls-ca", "--token-file") if "--server" in arguments_of(item) else ():
            if flag not in arguments_of(item):
                yield f"{name} has no {flag}"
    namespace = server["metadata"]["namespace"]
    wanted = {
        f"STELLATED_{i}": f"stellated-{i}.{server['spec']['serviceName']}.{namespace}.svc.cluster.local:7717"
        for i in range(server["spec"]["replicas"])
    }
    given = {
        e["name"]: e["value"]
        for e in container_of(objects["Deployment", "proxy"]).get("env", [])
        if re.fullmatch(r"STELLATED_\d+", e["name"])
    }
    if given != wanted:
        yield f"the proxy leads to {given}, and servers are {wanted}"
    used = set(re.findall(r"STELLATED_\d+", balancer(objects)))
    if not set(wanted) <= used:
        yield f"haproxy.cfg knows {sorted(used)}"
    if not objects["Service", "stellated"]["spec"].get("publishNotReadyAddresses"):
        yield "the proxy loses the names of servers that are not ready"


def policies(objects: Objects) -> Iterator[str]:
    """Who may speak with whom, both ends agreeing; everybody else may not."""
    found = {
        name: item["spec"] for (kind, name), item in objects.items() if kind == "NetworkPolicy"
    }
    closed = {"podSelector": {}, "policyTypes": ["Ingress", "Egress"]}
    if closed not in found.values():
        yield "no NetworkPolicy closes the namespace"
    for name, item in workloads(objects).items():
        ports = {port["name"] for port in container_of(item).get("ports", [])}
        labels = item["spec"]["template"]["metadata"]["labels"]
        about = [spec for spec in found.values() if spec != closed
                 and spec["podSelector"].get("matchLabels", {}).items() <= labels.items()]  # fmt: skip
        if len(about) != 1:
            yield f"{len(about)} NetworkPolicies are about {name}"
        for way in (way for spec in about for way in spec.get("ingress", [])):
            for port in way.get("ports", [{}]):
                if port.get("port") not in ports:
                    yield f"{name} is let in to at port {port.get('port')}"
    # Servers are for the proxy and for Prometheus.
    allowed = [list(find(way.get("from", []), "app.kubernetes.io/name")) or
               list(find(way.get("from", []), "kubernetes.io/metadata.name"))
               for way in found.get("stellated", {}).get("ingress", [])]  # fmt: skip
    others = (
        ["stellated"] if "--database" in arguments_of(objects["StatefulSet", "stellated"]) else []
    )
    if allowed != [["proxy", *others], ["monitoring"]]:
        yield f"servers may be called by {allowed}"


def _secrets(name: str, item: Object, objects: Objects) -> Iterator[str]:
    """What its program reads is mounted, and docker/make-secrets makes it."""
    volumes = {volume["name"]: volume for volume in pod_of(item).get("volumes", [])}
    there = set()
    for mount in container_of(item).get("volumeMounts", []):
        for secret, entry in secrets_of(volumes.get(mount["name"], {})):
            there.add(f"{mount['mountPath']}/{entry['path']}")
            if secret == "stellate" and entry["key"] not in {*made_secrets(), "database"}:
                yield f"{name}: docker/make-secrets makes no {entry['key']}"
        config = volumes.get(mount["name"], {}).get("configMap", {}).get("name")
        made = {c["name"] for c in kustomization()["configMapGenerator"]}
        if config and config not in made and ("ConfigMap", config) not in objects:
            yield f"{name}: there is no ConfigMap {config}"
    text = json.dumps(container_of(item))
    if name == "proxy":
        text = balancer(objects)
    for path in set(re.findall(r"/etc/stellate/[\w.]+", text)) - there:
        yield f"{name} reads {path}, which is not mounted"


@functools.cache
def made_secrets() -> set[str]:
    """The files that docker/make-secrets makes."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([ROOT / "docker" / "make-secrets", folder], check=True, capture_output=True)
        return {file.name for file in pathlib.Path(folder).iterdir() if file.is_file()}
