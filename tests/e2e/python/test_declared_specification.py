"""`stellate declare` asks a server for what Client.create asks for, with the same options and without."""

import pathlib
import subprocess

import pytest
import stellate
from stellate import manifolds
from stellate._generated import stellate_pb2

STELLATE = pathlib.Path(stellate.server.find_stellated()).parent / "stellate"


def criteria(client, name):
    """As the server takes them: what was left out, too."""
    request = stellate_pb2.GetMeshRequest(name=name)
    return client._call(client._stub.GetMesh, request).spec.criteria


def declared(client, *options):
    command = [STELLATE, "declare", "so3", "-e", "0.4", "--server", client.address, *options]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return criteria(client, done.stdout.strip())


def created(client, **options):
    rotations = manifolds.SpecialOrthogonal3()
    return criteria(client, client.create(rotations, 0.4, **options).name)


def test_what_nobody_says_is_left_to_the_server(client):
    assert declared(client) == created(client)


@pytest.mark.parametrize("name", ["speculative", "common_centre"])
@pytest.mark.parametrize("wanted", [True, False])
def test_what_is_said_is_declared(client, name, wanted):
    flag = ("--" if wanted else "--no-") + name.replace("_", "-")
    assert declared(client, flag) == created(client, **{name: wanted})
    assert getattr(created(client, **{name: wanted}), name) is wanted
