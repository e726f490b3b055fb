"""What may be wrong with docker/kubernetes/monitor.yaml, a kind that python3-kubernetes does not know."""

from __future__ import annotations

import re
from collections.abc import Iterator

import yaml
from kubernetes_objects import MANIFESTS, ROOT, Object, Objects

# Those of monitoring.coreos.com/v1 that it has use for.
_SPEC = {"namespaceSelector", "selector", "endpoints"}
_ENDPOINT = {"port", "path", "interval"}


def load() -> Object:
    """The ServiceMonitor."""
    return dict(yaml.safe_load((MANIFESTS / "monitor.yaml").read_text()))


def problems(monitor: Object, objects: Objects) -> list[str]:
    """In words; none if it finds the servers' metrics, and may read them."""
    return list(_problems(monitor, objects))


def _problems(monitor: Object, objects: Objects) -> Iterator[str]:
    if (monitor["apiVersion"], monitor["kind"]) != ("monitoring.coreos.com/v1", "ServiceMonitor"):
        yield "it is no ServiceMonitor of monitoring.coreos.com/v1"
    spec = monitor["spec"]
    yield from (f"spec has no such field: {field}" for field in spec.keys() - _SPEC)
    wanted = spec.get("selector", {}).get("matchLabels", {})
    chosen = [
        service
        for (kind, _), service in objects.items()
        if kind == "Service"
        and service["metadata"]["namespace"]
        in spec.get("namespaceSelector", {}).get("matchNames", [])
        and wanted.items() <= service["metadata"].get("labels", {}).items()
    ]
    names = [service["metadata"]["name"] for service in chosen]
    if names != ["stellated"]:
        yield f"it chooses the Services {names}"
        return
    rules = (ROOT / "docker" / "prometheus" / "rules.yml").read_text()
    jobs = set(re.findall(r'job="([^"]*)"', rules))
    if jobs != set(names):  # the operator calls a job by its Service
        yield f"alerts are about the jobs {jobs}, and metrics come in as {names}"
    ports = {port["name"] for port in chosen[0]["spec"]["ports"]}
    for endpoint in spec.get("endpoints", []) or [{}]:
        yield from (f"an endpoint has no such field: {f}" for f in endpoint.keys() - _ENDPOINT)
        if endpoint.get("port") not in ports - {"grpc"}:
            yield f"it reads the port {endpoint.get('port')} of {ports}"
        if endpoint.get("path", "/metrics") != "/metrics":
            yield f"there are no metrics at {endpoint['path']}"
        if not re.fullmatch(r"\d+(ms|s|m)", str(endpoint.get("interval", "30s"))):
            yield f"{endpoint['interval']} is no interval"
    let_in = [
        peer["namespaceSelector"]["matchLabels"]["kubernetes.io/metadata.name"]
        for rule in objects["NetworkPolicy", "stellated"]["spec"]["ingress"]
        for peer in rule["from"]
        if "namespaceSelector" in peer
    ]
    if monitor["metadata"].get("namespace") not in let_in:
        yield f"the network lets in {let_in} alone to metrics"
