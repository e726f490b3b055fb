"""A Python program's own server, for workers on other machines."""

import concurrent.futures as futures
import socket
import subprocess
import sys

import pytest
import stellate
from stellate import manifolds

WORKER = """
import sys
sys.path.insert(0, sys.argv[1])
import stellate
print(stellate.serve(stellate.manifolds.Torus(), sys.argv[3], server=sys.argv[2]))
"""


def test_plain_text_beyond_the_loopback_has_to_be_asked_for():
    with pytest.raises(stellate.Unavailable, match="--insecure-listen"):
        stellate.Server(listen="0.0.0.0:0")


@pytest.mark.parametrize("known", [True, False])
def test_it_is_reached_by_this_machines_name(repository, monkeypatch, known):
    """Or by its address, where its name is known to nobody."""
    name = "localhost" if known else "nobody.invalid"
    monkeypatch.setattr(socket, "gethostname", lambda: name)
    with stellate.Server(listen="0.0.0.0:0", insecure_listen=True) as server:
        host, _, port = server.address.rpartition(":")
        assert (host == name) == known and int(port) > 0
        with stellate.Client(server) as client:
            name = client.create(manifolds.Torus(), 0.3).name
            command = [sys.executable, "-c", WORKER, repository / "clients" / "python"]
            command += [server.address, name]
            worker = subprocess.run(command, capture_output=True, text=True, timeout=100)
            assert worker.stdout == "SUCCEEDED\n", worker.stderr
            assert stellate.download(name, server=client).certified


def test_a_host_that_is_given_is_the_address():
    with stellate.Server(listen="127.0.0.1:0") as server:
        assert server.address.startswith("127.0.0.1:") and not server.address.endswith(":0")
        assert stellate.mesh(manifolds.Torus(), 0.3, server=server).certified


def test_tokens_are_asked_for(tmp_path):
    (tmp_path / "tokens").write_text("alice alice-0123456789abcdef\n")
    with stellate.Server(listen="127.0.0.1:0", token_file=tmp_path / "tokens") as server:
        with pytest.raises(stellate.Unauthenticated):
            stellate.mesh(manifolds.Torus(), 0.3, server=server)
        alice = stellate.Credentials(token="alice-0123456789abcdef")
        with stellate.Client(server, alice) as client, futures.ThreadPoolExecutor(1) as pool:
            name = client.create(manifolds.Torus(), 0.3).name
            workers = stellate.executors.workers_on(
                pool, manifolds.Torus(), name, 2, server=server, credentials=alice
            )
            assert workers.wait() == ["SUCCEEDED", "SUCCEEDED"]


def test_what_the_server_says_of_bad_files_is_passed_on(tmp_path):
    with pytest.raises(stellate.Unavailable, match="nowhere.pem"):
        stellate.Server(
            listen="0.0.0.0:0", tls_cert=tmp_path / "nowhere.pem", tls_key=tmp_path / "nowhere.key"
        )
