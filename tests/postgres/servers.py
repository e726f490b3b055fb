"""What is tried with: servers that share a database, HAProxy before them, and meshes under way."""

from __future__ import annotations

import contextlib
import datetime
import json
import os
import pathlib
import re
import shlex
import shutil
import signal
import socket
import subprocess
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from typing import Callable

import stellate
from stellate import manifolds

PATIENCE = float(
    os.environ.get("STELLATE_PATIENCE", 120)
)  # seconds: for a hang, not for a measurement
EPSILON = 0.15
HAPROXY = shutil.which("haproxy", path=os.environ.get("PATH", "") + ":/usr/sbin") or "haproxy"
ROOT = pathlib.Path(__file__).resolve().parents[2]


def wait_for(what: Callable[[], object]) -> None:
    until = time.monotonic() + PATIENCE
    while not what():
        assert time.monotonic() < until, "waited in vain"
        time.sleep(0.01)


def sql(database: str, statement: str) -> str:
    command = ["psql", database, "--no-psqlrc", "-qtAX", "-v", "ON_ERROR_STOP=1", "-c", statement]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


@contextlib.contextmanager
def holding(database: str, rows: str) -> Iterator[None]:
    """Holds these rows: statements that would change them wait until this ends."""
    command = ["psql", database, "--no-psqlrc", "-qtAX", "-v", "ON_ERROR_STOP=1"]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as session:
        session.stdin.write(f"BEGIN;\n{rows} FOR UPDATE;\n\\echo held\n")
        session.stdin.flush()
        assert "held" in iter(lambda: session.stdout.readline().strip() or "gone", "gone")
        yield
        session.stdin.close()
        session.wait(PATIENCE)


def control(*words: str) -> None:
    """Stops or starts the database."""
    command = [*shlex.split(os.environ["STELLATE_TEST_PG_CTL"]), *words]
    subprocess.run(command, check=True, cwd="/tmp", stdout=subprocess.DEVNULL)


def free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


class Server:
    """A stellated that keeps nothing in its directory."""

    def __init__(self, folder: pathlib.Path, name: str, *flags: str) -> None:
        self.address = f"127.0.0.1:{free_port()}"
        self._folder, self._name, self._flags = folder, name, flags
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        self._ready = self._folder / f"{self._name}.ready"
        self._ready.unlink(missing_ok=True)
        command = [stellate.server.find_stellated(), "--listen", self.address]
        command += ["--ready-file", str(self._ready), "--database", str(self._folder / "url")]
        command += ["--exit-with-parent", "--drain-seconds", "0", *self._flags]
        self._metrics = f"127.0.0.1:{free_port()}"
        command += ["--metrics-listen", self._metrics]
        self._home = self._folder / self._name
        self._home.mkdir(exist_ok=True)
        with open(self._folder / f"{self._name}.log", "ab") as log:
            self.process = subprocess.Popen(
                command, cwd=self._home, stdout=subprocess.DEVNULL, stderr=log
            )

    def is_ready(self) -> bool:
        assert self.process.poll() is None, self.log()
        return self._ready.exists()

    def page(self, path: str) -> tuple[int, str]:
        """The status and the text of what it shows to Prometheus and to probes."""
        try:
            with urllib.request.urlopen(f"http://{self._metrics}{path}") as page:
                return page.status, page.read().decode()
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode()

    def sees_database(self) -> bool:
        return "\nstellate_database_up 1\n" in self.page("/metrics")[1]

    def log(self) -> str:
        return (self._folder / f"{self._name}.log").read_text()

    def logged(self, message: str) -> list[float]:
        """When it said that, in seconds since 1970. Of one with --log-format json."""
        lines = re.findall(r"^\{.*\}$", self.log(), re.M)
        return [
            datetime.datetime.fromisoformat(entry["time"]).timestamp()
            for entry in map(json.loads, lines)
            if entry["message"] == message
        ]

    def end(self, how: signal.Signals = signal.SIGKILL) -> int:
        """Its directory goes with it."""
        self.process.send_signal(how)
        status = self.process.wait(PATIENCE)
        shutil.rmtree(self._home)
        return status


class Cluster:
    """A new database, and what is started upon it. A context manager: nothing stays."""

    def __init__(self, folder: pathlib.Path) -> None:
        self._folder = folder
        self.servers: list[Server] = []
        self._proxies: list[subprocess.Popen[bytes]] = []
        anything = os.environ["STELLATE_TEST_DATABASE"]
        name = f"takeover_{os.getpid()}_{abs(hash(folder))}"
        sql(anything, f"CREATE DATABASE {name}")
        self.database = anything.replace("/postgres?", f"/{name}?")
        self.have_them_read(self.database)

    def have_them_read(self, url: str) -> None:
        """What servers that are started from now on find in the file of --database."""
        (self._folder / "url").write_text(url + "\n")
        (self._folder / "url").chmod(0o600)

    def add(self, name: str, *flags: str) -> Server:
        """A server that is to be started."""
        self.servers.append(Server(self._folder, name, *flags))
        return self.servers[-1]

    def start(self, name: str, *flags: str) -> Server:
        """One that is started, and may not be ready yet."""
        self.add(name, *flags).start()
        return self.servers[-1]

    def ready(self, *names: str, flags: tuple[str, ...] = ()) -> list[Server]:
        """Servers that are."""
        started = [self.start(name, *flags) for name in names]
        for server in started:
            wait_for(server.is_ready)
        return started

    def front(self, *servers: Server, text: str = "", **environment: str) -> str:
        """HAProxy before servers, as docker/postgres or that text configures it."""
        port, config = free_port(), self._folder / f"haproxy-{len(self._proxies)}.cfg"
        text = text or (ROOT / "docker/postgres/haproxy.cfg").read_text()
        assert text.count("bind :7717") == 1
        text = text.replace("bind :7717", f"bind 127.0.0.1:{port}")
        for i in range(2, len(servers)):
            text += f'    server stellated-{i} "${{STELLATED_{i}}}"\n'
        config.write_text(text)
        environment |= {f"STELLATED_{i}": server.address for i, server in enumerate(servers)}
        command = [HAPROXY, "-db", "-f", str(config)]
        self._proxies.append(
            subprocess.Popen(
                command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
        )
        wait_for(lambda: listens(port))
        return f"127.0.0.1:{port}"

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *raised: object) -> None:
        for process in [*(server.process for server in self.servers), *self._proxies]:
            if process is not None and process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.kill()
                process.wait(PATIENCE)


class Gated(manifolds.Torus):
    """A torus that says when its fifth batch has come, and then waits until it may go on."""

    def __init__(self) -> None:
        super().__init__()
        self.asked: list[float] = []  # when
        self.reached, self.go = threading.Event(), threading.Event()

    def closest_point(self, points):
        self.asked.append(time.monotonic())
        if len(self.asked) == 5:
            self.reached.set()
            assert self.go.wait(PATIENCE)
        return super().closest_point(points)


class Made(threading.Thread):
    """A mesh on its way in a thread: its one worker, and its watcher."""

    def __init__(self, address: str, credentials: stellate.Credentials | None = None) -> None:
        super().__init__(daemon=True)
        self._address, self._credentials, self.oracle = address, credentials, Gated()
        self.mesh: stellate.Mesh | None = None
        self.error: Exception | None = None
        self.start()

    def run(self) -> None:
        try:
            with stellate.Client(
                self._address, self._credentials, reconnect_seconds=PATIENCE
            ) as client:
                self.mesh = stellate.mesh(self.oracle, EPSILON, server=client)
        except Exception as error:  # shown by who waits for it
            self.error = error

    def reach(self) -> None:
        wait_for(lambda: self.oracle.reached.is_set() or not self.is_alive())
        assert self.oracle.reached.is_set(), self.error


def are_same(one: stellate.Mesh, other: stellate.Mesh) -> bool:
    """Bit for bit."""
    return (
        one.points.tobytes() == other.points.tobytes()
        and one.simplices.tobytes() == other.simplices.tobytes()
    )


def make_undisturbed() -> stellate.Mesh:
    with stellate.Server() as server, stellate.Client(server) as client:
        return stellate.mesh(manifolds.Torus(), EPSILON, server=client)


def finish(meshes: list[Made], expected: stellate.Mesh) -> None:
    for made in meshes:
        made.oracle.go.set()
    for made in meshes:
        made.join(PATIENCE)
        assert made.mesh is not None, made.error or "it does not end"
        assert made.mesh.certified and are_same(made.mesh, expected)


def running(database: str) -> list[str]:
    """The addresses of the servers that have meshes under way, one for each mesh."""
    rows = sql(
        database,
        "SELECT address FROM stellate.meshes AS m JOIN stellate.servers AS s ON s.id = m.server "
        "WHERE NOT ended ORDER BY m.id",
    )
    return rows.split()


def owner(of: list[Server], database: str) -> Server:
    """One that has a mesh under way."""
    wait_for(lambda: running(database))
    return next(server for server in of if server.address in running(database))
