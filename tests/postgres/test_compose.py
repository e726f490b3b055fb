"""What docker/failover.yaml says, done without containers: its servers, its proxy, and TLS."""

from __future__ import annotations

import signal
import subprocess

import stellate
import yaml
from servers import ROOT, Made, finish, owner, running, wait_for

# Of a container, in the place of which there is this machine.
_PLACES = {"--listen", "--database", "--metrics-listen"}


def test_a_mesh_goes_on_when_a_server_of_the_compose_file_freezes(cluster, undisturbed, tmp_path):
    """The proxy sees over TLS that it does, and leads to the other."""
    services = yaml.safe_load((ROOT / "docker/failover.yaml").read_text())["services"]
    secrets = tmp_path / "secrets"
    subprocess.run([ROOT / "docker/make-secrets", secrets], check=True, capture_output=True)
    pair = []
    for name in ("stellated-0", "stellated-1"):
        given = dict(flag.split("=", 1) for flag in services[name]["command"])
        assert given.keys() >= _PLACES
        flags = [
            f"{flag}={value.replace('/etc/stellate', str(secrets))}"
            for flag, value in given.items()
            if flag not in _PLACES
        ]
        pair += cluster.ready(name, flags=tuple(flags))
    environment = services["proxy"]["environment"]
    asked = {name: text for name, text in environment.items() if not name[-1].isdigit()}
    token = (secrets / "me.token").read_text().strip()
    friend = stellate.Credentials(ca=secrets / "ca.pem", token=token)
    made = Made(cluster.front(*pair, **asked), friend)
    made.reach()
    frozen = owner(pair, cluster.database)
    (other,) = (server for server in pair if server is not frozen)
    frozen.process.send_signal(signal.SIGSTOP)
    wait_for(lambda: running(cluster.database) == [other.address])
    finish([made], undisturbed)
