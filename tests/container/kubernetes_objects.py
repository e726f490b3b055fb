"""The Kubernetes objects of docker/kubernetes, and what they are made of."""

from __future__ import annotations

import pathlib
from collections.abc import Iterator
from typing import Any

import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
MANIFESTS = ROOT / "docker" / "kubernetes"
Object = dict[str, Any]
Objects = dict[tuple[str, str], Object]


def load() -> Objects:
    """All of them, by kind and name."""
    found = {}
    for resource in kustomization()["resources"]:
        for item in yaml.safe_load_all((MANIFESTS / resource).read_text()):
            found[item["kind"], item["metadata"]["name"]] = item
    return found


def kustomization() -> Object:
    """What kubectl applies."""
    return yaml.safe_load((MANIFESTS / "kustomization.yaml").read_text())


def pod_of(item: Object) -> Object:
    """A workload's pod."""
    return item["spec"]["template"]["spec"]


def container_of(item: Object) -> Object:
    """Its one container."""
    return pod_of(item)["containers"][0]


def arguments_of(item: Object) -> dict[str, str]:
    """What its program is given; "" for flags without a value."""
    pairs = (argument.partition("=") for argument in container_of(item).get("args", []))
    return {flag: value for flag, _, value in pairs}


def balancer(objects: Objects) -> str:
    """HAProxy's configuration: of a ConfigMap, or what kustomize makes one of."""
    if ("ConfigMap", "proxy") in objects:
        return str(objects["ConfigMap", "proxy"]["data"]["haproxy.cfg"])
    return (MANIFESTS / "haproxy.cfg").read_text()


def secrets_of(volume: Object) -> list[tuple[str, Object]]:
    """Its files of secrets: each the secret's name, and which key lies at which path."""
    if "secret" in volume:
        return [(volume["secret"]["secretName"], entry) for entry in volume["secret"]["items"]]
    sources = [source["secret"] for source in volume.get("projected", {}).get("sources", [])]
    return [(source["name"], entry) for source in sources for entry in source["items"]]


def workloads(objects: Objects) -> dict[str, Object]:
    """What has pods, by name."""
    return {name: o for (kind, name), o in objects.items() if kind in ("StatefulSet", "Deployment")}


def version() -> str:
    """Of this source tree."""
    return (ROOT / "VERSION").read_text().strip()


def find(tree: Any, key: str) -> Iterator[Any]:
    """All that is under that key, however deep."""
    for inner, value in (
        tree.items()
        if isinstance(tree, dict)
        else enumerate(tree if isinstance(tree, list) else [])
    ):
        if inner == key:
            yield value
        yield from find(value, key)
