"""Holds docker/'s compose files to what they are made for; docker-compose checks their form."""

from __future__ import annotations

import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest
import urllib.parse
from typing import Any

import manifest_safety
import manifests
import yaml
from kubernetes_objects import ROOT

sys.path.insert(0, str(ROOT / "clients" / "python"))

import stellate  # noqa: E402

COMPOSE = ROOT / "docker" / "compose.yaml"


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


def given_to(service: dict[str, Any]) -> dict[str, str]:
    """The flags of a service's command, with their values."""
    return dict(flag.split("=", 1) for flag in service["command"])


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


if __name__ == "__main__":
    unittest.main()
