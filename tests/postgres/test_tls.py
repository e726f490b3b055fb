"""Calls between servers over TLS."""

from __future__ import annotations

import pathlib
import subprocess

import pytest
import stellate
from servers import EPSILON, ROOT, Cluster, Server, are_same, wait_for
from stellate import manifolds


class Authority:
    """Certificates for this machine, all of one authority, and a token."""

    def __init__(self, folder: pathlib.Path) -> None:
        self.folder, self._made = folder, 0
        self._make()
        self.token = (folder / "me.token").read_text().strip()
        self.ca = folder / "ca.pem"

    def _make(self) -> None:
        command = [ROOT / "docker" / "make-secrets", self.folder]
        subprocess.run(command, check=True, capture_output=True)

    def certificate(self) -> pathlib.Path:
        """Another one, with its key."""
        self._made += 1
        made = self.folder / f"{self._made}.pem"
        (self.folder / "proxy.pem").rename(made)
        self._make()
        return made

    def flags(self, certificate: pathlib.Path) -> tuple[str, ...]:
        return (
            *("--tls-cert", str(certificate), "--tls-key", str(certificate)),
            *("--token-file", str(self.folder / "tokens")),
        )

    def client(self, server: Server, **options) -> stellate.Client:
        who = stellate.Credentials(ca=self.ca, token=self.token)
        return stellate.Client(server.address, who, **options)


@pytest.fixture
def authority(tmp_path):
    return Authority(tmp_path / "secrets")


def declare(authority: Authority, server: Server) -> str:
    with authority.client(server) as client:
        return client.create(manifolds.Torus(), EPSILON, worker_wait_seconds=86400).name


def test_calls_go_from_server_to_server(cluster: Cluster, authority, undisturbed):
    flags = authority.flags(authority.certificate())
    first, second = cluster.ready("first", "second", flags=flags)
    name = declare(authority, first)
    with authority.client(second) as client:
        wait_for(lambda: [mesh.name for mesh in client.list()] == [name])
        assert client.get(name).state == "WAITING"
        assert client.serve(manifolds.Torus(), name) == "SUCCEEDED"
        assert are_same(stellate.download(name, server=client), undisturbed)


def test_a_server_with_another_certificate_gets_no_call(cluster: Cluster, authority):
    (first,) = cluster.ready("first", flags=authority.flags(authority.certificate()))
    (second,) = cluster.ready("second", flags=authority.flags(authority.certificate()))
    name = declare(authority, first)
    with authority.client(second, reconnect_seconds=0) as client:
        with pytest.raises(stellate.Unavailable, match="the server that has the mesh does not"):
            client.get(name)
        with pytest.raises(stellate.Unavailable, match="the server that has the mesh does not"):
            stellate.download(name, server=client)
    assert "all that share a database have one" in second.log()
    with authority.client(first) as client:
        assert client.get(name).state == "WAITING", "where it is it can be called"


def test_the_proxy_of_a_cluster_leads_owners_to_servers_that_live(
    cluster: Cluster, authority, undisturbed
):
    """Each in turn: an owner's calls go to one of them while it lives."""
    folder = authority.folder
    flags = (
        *("--tls-cert", str(folder / "server.pem"), "--tls-key", str(folder / "server.key")),
        *("--token-file", str(folder / "tokens")),
    )
    servers = cluster.ready("first", "second", flags=flags)
    text = (ROOT / "docker/kubernetes/haproxy.cfg").read_text()
    text = text.replace("/etc/stellate", str(folder))
    proxy = cluster.front(*servers, text=text, STELLATED_SHARE_DATABASE="1")
    who = stellate.Credentials(ca=authority.ca, token=authority.token)
    for server in servers:
        server.end()
        with stellate.Client(proxy.replace("127.0.0.1", "localhost"), who) as client:
            assert are_same(stellate.mesh(manifolds.Torus(), EPSILON, server=client), undisturbed)
        server.start()
        wait_for(server.is_ready)
