"""What has to hold of docker/kubernetes, as functions that say in words what does not.

Kubernetes' own Python client says which fields its objects have and of which types; the programs
themselves say which flags and values they take. The rest is what no schema can see: that selectors
find their pods, probes their ports, volumes their mounts.
"""

from __future__ import annotations

import functools
import os
import pathlib
import re
import subprocess
import sys
from collections.abc import Container, Iterator
from typing import Any

import manifest_safety
from kubernetes.client import models
from kubernetes_objects import (
    ROOT,
    Objects,
    arguments_of,
    container_of,
    find,
    kustomization,
    pod_of,
    version,
    workloads,
)  # fmt: skip

WORKER = [sys.executable, "-B", str(ROOT / "docker" / "oracle_worker.py")]

# Newer than Debian's client, which knows it by its name before that.
_MODELS = {("autoscaling/v2", "HorizontalPodAutoscaler"): "V2beta2HorizontalPodAutoscaler"}
# What is served by every Kubernetes from 1.25 on.
_VERSIONS = {
    "Namespace": "v1",
    "ConfigMap": "v1",
    "Service": "v1",
    "NetworkPolicy": "networking.k8s.io/v1",
    "StatefulSet": "apps/v1",
    "Deployment": "apps/v1",
    "PodDisruptionBudget": "policy/v1",
    "HorizontalPodAutoscaler": "autoscaling/v2",
}
_QUANTITY = re.compile(r"[0-9]+(\.[0-9]+)?(m|k|M|G|T|Ki|Mi|Gi|Ti)?")


def problems(objects: Objects, without: Container[str] = ()) -> list[str]:
    """All that is wrong, rules of some names left out. Later rules take for granted what earlier ones see to."""
    rules = (_schema, _placement, _programs, _selectors, _ports, _volumes, _numbers, _confinement,
             manifest_safety.ways_in, manifest_safety.policies)  # fmt: skip
    for rule in rules:
        if rule.__name__ in without:
            continue
        if found := list(rule(objects)):
            return found
    return []


def _schema(objects: Objects) -> Iterator[str]:
    for (kind, name), item in objects.items():
        version = item["apiVersion"]
        if version != _VERSIONS.get(kind):
            yield f"{kind}/{name}: {version} is not where it is"
            continue
        model = _MODELS.get((version, kind), f"{version.split('/')[-1].capitalize()}{kind}")
        yield from misfits(item, model, f"{kind}/{name}")


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
        elif re.search(r"\.(requests|limits)\.\w+$", path) and not _QUANTITY.fullmatch(str(value)):
            yield f"{path} is no quantity: {value!r}"
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
    for key, element in value.items():
        if key not in fields:
            yield f"{path}.{key}: {kind} has no such field"
        else:
            yield from misfits(element, fields[key], f"{path}.{key}")
    try:  # the constructor refuses objects that lack what they must have
        model(**{name: value.get(key) for name, key in model.attribute_map.items()})
    except ValueError as error:
        yield f"{path}: {error}"


def _placement(objects: Objects) -> Iterator[str]:
    namespaces = {name for kind, name in objects if kind == "Namespace"}
    for (kind, name), item in objects.items():
        if kind != "Namespace" and item["metadata"].get("namespace") not in namespaces:
            yield f"{kind}/{name} is in no namespace of ours"
    known = {image["name"] for image in kustomization()["images"]}
    for image in kustomization()["images"]:
        ours = image["name"].startswith("stellate")
        if (
            not re.fullmatch(r"\d+\.\d+\.\d+", image["newTag"])
            or ours
            and image["newTag"] != version()
        ):
            yield f"{image['name']} is of no version: {image['newTag']}"
    for name, item in workloads(objects).items():
        if len(pod_of(item)["containers"]) != 1:
            yield f"{name} has to have one container"
        elif container_of(item)["image"] not in known:
            yield f"{name}: kustomization.yaml knows no image {container_of(item)['image']}"


def _selectors(objects: Objects) -> Iterator[str]:
    labels = {
        name: item["spec"]["template"]["metadata"]["labels"]
        for name, item in workloads(objects).items()
    }

    def selected(wanted: dict[str, str]) -> list[str]:
        return [name for name, has in labels.items() if wanted and wanted.items() <= has.items()]

    guarded = []
    for (kind, name), item in objects.items():
        spec = item.get("spec", {})
        wanted = spec.get("selector", {})
        if kind in ("StatefulSet", "Deployment") and selected(wanted["matchLabels"]) != [name]:
            yield f"{kind}/{name} has to select its own pods and no others"
        if kind in ("PodDisruptionBudget", "Service"):
            found = selected(wanted["matchLabels"] if kind != "Service" else wanted)
            if found != [name]:
                yield f"{kind}/{name} selects the pods of {found}"
            guarded += found if kind == "PodDisruptionBudget" else []
        if kind == "HorizontalPodAutoscaler":
            target = spec["scaleTargetRef"]
            scaled = objects.get((target["kind"], target["name"]))
            if scaled is None or scaled["apiVersion"] != target["apiVersion"]:
                yield f"{kind}/{name} scales nothing: {target}"
            elif "replicas" in scaled["spec"]:
                yield f"{target['name']} sets replicas, which are the autoscaler's"
    if sorted(guarded) != sorted(n for n in labels if least_of(objects, n) > 1):
        yield f"PodDisruptionBudgets guard {guarded}"
    for name, item in workloads(objects).items():
        for term in find(pod_of(item), "podAffinityTerm"):
            if selected(term["labelSelector"]["matchLabels"]) != [name]:
                yield f"{name}: its affinity is for other pods"


def _ports(objects: Objects) -> Iterator[str]:
    server = objects["StatefulSet", "stellated"]
    container, arguments = container_of(server), arguments_of(server)
    ports = {port["name"]: port["containerPort"] for port in container["ports"]}
    for name, flag in (("grpc", "--listen"), ("metrics", "--metrics-listen")):
        if not arguments.get(flag, "").endswith(f":{ports.get(name)}"):
            yield f"{flag}={arguments.get(flag)}, but the port {name} is {ports.get(name)}"
    scraped = server["spec"]["template"]["metadata"]["annotations"]["prometheus.io/port"]
    if scraped != str(ports.get("metrics")):
        yield f"Prometheus is sent to port {scraped}"
    for probe, service in (
        ("startupProbe", ""), ("readinessProbe", "stellate.v1.Stellate"), ("livenessProbe", "alive"),
    ):  # fmt: skip
        asked = container.get(probe, {}).get("exec", {}).get("command", [])
        wanted = ["stellated-health"] + [f"--health-service={service}"] * bool(service)
        if asked != wanted:
            yield f"{probe} asks {asked}, not {wanted}"
    front = container_of(objects["Deployment", "proxy"])
    for probe in ("readinessProbe", "livenessProbe"):
        asked = front.get(probe, {}).get("tcpSocket", {}).get("port")
        if asked not in {port["name"] for port in front["ports"]}:
            yield f"the proxy's {probe} asks port {asked}"
    service = objects.get(("Service", server["spec"]["serviceName"]))
    if service is None or service["spec"].get("clusterIP") != "None":
        return (yield f"there is no headless Service {server['spec']['serviceName']}")
    for port in service["spec"]["ports"]:
        target = port.get("targetPort", port["port"])
        if target not in ports and target not in ports.values():
            yield f"the Service leads to port {target}"
    way_in = objects["Service", "proxy"]
    offered = {
        f"{way_in['metadata']['name']}:{port['port']}"
        for port in way_in["spec"]["ports"]
        if port.get("targetPort") in {port["name"] for port in front["ports"]}
    }
    for name, item in workloads(objects).items():
        asked_for = arguments_of(item).get("--server")
        if asked_for is not None and asked_for not in offered:
            yield f"{name} looks for a server at {asked_for}"


def _volumes(objects: Objects) -> Iterator[str]:
    server = objects["StatefulSet", "stellated"]
    claims = {c["metadata"]["name"]: c["spec"] for c in server["spec"]["volumeClaimTemplates"]}
    mounts = {m["name"]: m for m in container_of(server).get("volumeMounts", [])}
    for name, item in workloads(objects).items():
        has = {volume["name"]: volume for volume in pod_of(item).get("volumes", [])}
        wanted = {m["name"] for m in container_of(item).get("volumeMounts", [])}
        if {*has, *(claims if item is server else ())} != wanted:
            yield f"{name}: volumes {sorted(has)}, but mounts {sorted(wanted)}"
    for name, claim in claims.items():
        if claim["accessModes"] != ["ReadWriteOnce"]:
            yield f"volume {name}: two servers cannot share a directory"
    data = pathlib.PurePosixPath(arguments_of(server).get("--data-dir", "/"))
    places = [m["mountPath"] for m in mounts.values() if not m.get("readOnly")]
    if not any(data.is_relative_to(place) for place in places):
        yield f"--data-dir={data} is in no volume, and the root file system is read-only"


def _numbers(objects: Objects) -> Iterator[str]:
    server = objects["StatefulSet", "stellated"]
    grace = pod_of(server).get("terminationGracePeriodSeconds", 30)
    drain = arguments_of(server).get("--drain-seconds", "10")
    if grace < float(drain) + 10:  # streams and meshers have some seconds besides
        yield f"pods are killed after {grace} s, but drain for {drain} s"
    for name, item in workloads(objects).items():
        scaler = objects.get(("HorizontalPodAutoscaler", name), {"spec": {}})["spec"]
        least = least_of(objects, name)
        if least > scaler.get("maxReplicas", least):
            yield f"{name}: at least {least} replicas, and at most {scaler['maxReplicas']}"
        if least == 1:  # it goes when its node goes
            continue
        budget = objects["PodDisruptionBudget", name]["spec"]
        stay = budget.get("minAvailable")
        leave = budget["maxUnavailable"] if stay is None else least - stay
        if not 0 < leave < least:
            yield f"PodDisruptionBudget/{name}: {leave} of {least} may leave at once"
        if scaler and "cpu" not in container_of(item)["resources"].get("requests", {}):
            yield f"{name} is scaled by a share of no request"


def least_of(objects: Objects, name: str) -> int:
    """How many pods a workload has at least."""
    scaler = objects.get(("HorizontalPodAutoscaler", name), {"spec": {}})["spec"]
    return int(scaler.get("minReplicas", workloads(objects)[name]["spec"].get("replicas", 1)))


def _confinement(objects: Objects) -> Iterator[str]:
    """The restricted Pod Security Standard, a read-only root and the image's own user."""
    namespace = objects["Namespace", "stellate"]["metadata"].get("labels", {})
    if namespace.get("pod-security.kubernetes.io/enforce") != "restricted":
        yield "the namespace does not enforce the restricted standard"
    user = re.search(r"^USER (\d+):(\d+)$", (ROOT / "docker/Dockerfile").read_text(), re.M)
    assert user is not None
    for name, item in workloads(objects).items():
        pod, container = pod_of(item), container_of(item)
        of_pod, of_container = pod.get("securityContext", {}), container.get("securityContext", {})
        wanted = {
            "runAsNonRoot": (of_pod, True),
            "runAsUser": (of_pod, int(user[1])),
            "seccompProfile": (of_pod, {"type": "RuntimeDefault"}),
            "automountServiceAccountToken": (pod, False),
            "readOnlyRootFilesystem": (of_container, True),
            "allowPrivilegeEscalation": (of_container, False),
            "capabilities": (of_container, {"drop": ["ALL"]}),
        }
        if "volumeClaimTemplates" in item["spec"]:
            wanted["fsGroup"] = (of_pod, int(user[2]))
        for field, (context, value) in wanted.items():
            if context.get(field) != value:
                yield f"{name}: {field} is {context.get(field)}"
        for forbidden in ("hostNetwork", "hostPID", "hostIPC", "hostPath", "hostPort"):
            if any(find(pod, forbidden)):
                yield f"{name} has {forbidden}"
        if "memory" not in container["resources"].get("limits", {}):
            yield f"{name} may take all memory"


def _programs(objects: Objects) -> Iterator[str]:
    """The programs know the flags, and read their values before they do as they are told."""
    for where, program, instead in (
        (("StatefulSet", "stellated"), [os.environ["STELLATED"]], "--print-config"),
        (("Deployment", "oracle-torus"), WORKER, "--help"),
    ):
        given = container_of(objects[where])["args"]
        for flag in sorted(flags_in(given) - flags_of(program)):
            yield f"{where[1]} knows no {flag}"
        done = _run(*program, *given, instead)
        if done.returncode:
            yield f"{where[1]}: {done.stderr.strip() or 'it refuses'}"


def flags_of(program: list[str]) -> set[str]:
    """What a program says it takes."""
    return set(re.findall(r"--[a-z][a-z-]*", _run(*program, "--help").stdout))


def flags_in(arguments: list[str]) -> set[str]:
    """What it is given."""
    return {argument.split("=")[0] for argument in arguments if argument.startswith("--")}


@functools.cache
def _run(*command: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "clients" / "python")}
    return subprocess.run(command, capture_output=True, text=True, env=environment)
