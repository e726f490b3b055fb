"""Servers that share a database of PostgreSQL, alone and behind HAProxy.

Whatever is killed, frozen or stopped, servers or the database, a mesh ends bit for bit as it would have
undisturbed, and any server takes any call. $STELLATE_MESHES: how many are under way at once (3);
$STELLATE_RESTARTS: how often the database is killed (3); $STELLATE_TAKEOVERS: how often one of three
servers is killed or stopped (4).
"""

from __future__ import annotations

import contextlib
import os
import pathlib
import random
import shlex
import shutil
import signal
import socket
import subprocess
import threading
import time
import urllib.request

import grpc
import numpy
import pytest
import stellate
from stellate import manifolds
from stellate._generated import mesh_pb2
from stellate._generated import stellate_pb2 as pb
from stellate._generated import stellate_pb2_grpc as pb_grpc
from stellate._reconnect import WAITS
from stellate._wire.arrays import to_wire

PATIENCE = float(
    os.environ.get("STELLATE_PATIENCE", 120)
)  # seconds: for a hang, not for a measurement
EPSILON = 0.15
HAPROXY = shutil.which("haproxy", path=os.environ.get("PATH", "") + ":/usr/sbin") or "haproxy"
ROOT = pathlib.Path(__file__).resolve().parents[2]


def number(name: str, otherwise: int) -> int:
    return int(os.environ.get(name, otherwise))


def wait_for(what) -> None:
    until = time.monotonic() + PATIENCE
    while not what():
        assert time.monotonic() < until, "waited in vain"
        time.sleep(0.01)


def sql(database: str, statement: str) -> str:
    command = ["psql", database, "--no-psqlrc", "-qtAX", "-v", "ON_ERROR_STOP=1", "-c", statement]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def control(*words: str) -> None:
    """Stops or starts the database."""
    command = [*shlex.split(os.environ["STELLATE_TEST_PG_CTL"]), *words]
    subprocess.run(command, check=True, cwd="/tmp", stdout=subprocess.DEVNULL)


class Server:
    """A stellated without a directory of its own."""

    def __init__(self, folder: pathlib.Path, name: str, url: str, *flags: str) -> None:
        self.address = f"127.0.0.1:{free_port()}"
        self._folder, self._name, self._url, self._flags = folder, name, url, flags
        self.start()

    def start(self) -> None:
        self._ready = self._folder / f"{self._name}.ready"
        self._ready.unlink(missing_ok=True)
        command = [stellate.server.find_stellated(), "--listen", self.address]
        command += ["--ready-file", str(self._ready), "--database", self._url]
        command += ["--exit-with-parent", "--drain-seconds", "0", *self._flags]
        self._metrics = f"127.0.0.1:{free_port()}"
        command += ["--metrics-listen", self._metrics]
        with open(self._folder / f"{self._name}.log", "ab") as log:
            self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=log)

    def is_ready(self) -> bool:
        assert self.process.poll() is None, self.log()
        return self._ready.exists()

    def sees_database(self) -> bool:
        with urllib.request.urlopen(f"http://{self._metrics}/metrics") as page:
            return "\nstellate_database_up 1\n" in page.read().decode()

    def log(self) -> str:
        return (self._folder / f"{self._name}.log").read_text()

    def end(self, how: signal.Signals = signal.SIGKILL) -> int:
        self.process.send_signal(how)
        return self.process.wait(PATIENCE)


def free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


@pytest.fixture
def database(tmp_path):
    """A new database, by a file that holds its URL."""
    anything = os.environ["STELLATE_TEST_DATABASE"]
    name = f"takeover_{os.getpid()}_{abs(hash(tmp_path))}"
    sql(anything, f"CREATE DATABASE {name}")
    url = anything.replace("/postgres?", f"/{name}?")
    (tmp_path / "url").write_text(url + "\n")
    (tmp_path / "url").chmod(0o600)
    return url


@pytest.fixture
def servers(tmp_path, database):
    """Starts servers of the database; the last line of defence against those left over."""
    started: list[Server] = []

    def start(name: str, *flags: str) -> Server:
        started.append(Server(tmp_path, name, str(tmp_path / "url"), *flags))
        return started[-1]

    yield start
    for server in started:
        if server.process.poll() is None:
            server.process.send_signal(signal.SIGCONT)
            server.end()


@pytest.fixture
def front(tmp_path):
    """Has HAProxy, as docker/postgres configures it, spread connections over the servers."""
    started = []

    def start(*servers: Server) -> str:
        port = free_port()
        text = (ROOT / "docker/postgres/haproxy.cfg").read_text()
        assert text.count("bind :7717") == 1
        (tmp_path / "haproxy.cfg").write_text(text.replace("bind :7717", f"bind 127.0.0.1:{port}"))
        text = (tmp_path / "haproxy.cfg").read_text()
        for i in range(2, len(servers)):
            text += f'    server stellated-{i} "${{STELLATED_{i}}}"\n'
        (tmp_path / "haproxy.cfg").write_text(text)
        environment = {f"STELLATED_{i}": server.address for i, server in enumerate(servers)}
        command = [HAPROXY, "-db", "-f", str(tmp_path / "haproxy.cfg")]
        started.append(subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL))
        wait_for(lambda: listens(port))
        return f"127.0.0.1:{port}"

    yield start
    for process in started:
        process.kill()
        process.wait(PATIENCE)


class Gated(manifolds.Torus):
    """A torus that says when its fifth batch has come, and then waits until it may go on."""

    def __init__(self) -> None:
        super().__init__()
        self._batches, self.reached, self.go = 0, threading.Event(), threading.Event()

    def closest_point(self, points):
        self._batches += 1
        if self._batches == 5:
            self.reached.set()
            assert self.go.wait(PATIENCE)
        return super().closest_point(points)


class Made(threading.Thread):
    """A mesh on its way in a thread: its one worker, and its watcher."""

    def __init__(self, address: str) -> None:
        super().__init__(daemon=True)
        self._address, self.oracle = address, Gated()
        self.mesh: stellate.Mesh | None = None
        self.error: Exception | None = None
        self.start()

    def run(self) -> None:
        try:
            with stellate.Client(self._address, reconnect_seconds=PATIENCE) as client:
                self.mesh = stellate.mesh(self.oracle, EPSILON, server=client)
        except Exception as error:  # shown by who waits for it
            self.error = error

    def reach(self) -> None:
        wait_for(lambda: self.oracle.reached.is_set() or not self.is_alive())
        assert self.oracle.reached.is_set(), self.error


@pytest.fixture(scope="module")
def undisturbed():
    with stellate.Server() as server, stellate.Client(server) as client:
        return stellate.mesh(manifolds.Torus(), EPSILON, server=client)


def finish(meshes: list[Made], expected: stellate.Mesh) -> None:
    for made in meshes:
        made.oracle.go.set()
    for made in meshes:
        made.join(PATIENCE)
        assert made.mesh is not None, made.error or "it does not end"
        assert made.mesh.certified
        assert made.mesh.points.tobytes() == expected.points.tobytes()
        assert made.mesh.simplices.tobytes() == expected.simplices.tobytes()


def test_a_server_killed_and_started_again_needs_no_directory(servers, undisturbed):
    server = servers("only")
    wait_for(server.is_ready)
    with stellate.Client(server.address) as client:
        finished = client.create(manifolds.Torus(), EPSILON)
        client.serve(manifolds.Torus(), finished.name)
    made = Made(server.address)
    made.reach()
    server.end()
    server.start()
    finish([made], undisturbed)
    with stellate.Client(server.address) as client:  # no worker, no replay
        kept = stellate.download(finished.name, server=client)
        assert kept.points.tobytes() == undisturbed.points.tobytes()
        assert client.get(finished.name).state == "SUCCEEDED"


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


def test_another_server_ends_the_meshes_of_one_that_is_killed(
    servers, front, undisturbed, database
):
    pair = [servers("first"), servers("second")]
    for server in pair:
        wait_for(server.is_ready)
    address = front(*pair)
    meshes = [Made(address) for _ in range(number("STELLATE_MESHES", 3))]
    for made in meshes:
        made.reach()
    owner(pair, database).end()
    finish(meshes, undisturbed)


def test_servers_that_come_and_go_lose_no_mesh(servers, front, undisturbed, database):
    """Stops and kills, drawn by a seed; whichever it is may have the mesh, or lead to it, or neither."""
    three = [servers(name) for name in ("first", "second", "third")]
    for server in three:
        wait_for(server.is_ready)
    address = front(*three)
    draw = random.Random(20)
    for _ in range(number("STELLATE_TAKEOVERS", 4)):
        meshes = [Made(address), Made(address)]
        for made in meshes:
            made.reach()
        chosen = draw.choice(three)
        chosen.end(draw.choice([signal.SIGTERM, signal.SIGKILL]))
        chosen.start()
        finish(meshes, undisturbed)
    wait_for(
        lambda: sql(database, "SELECT count(*) FROM stellate.meshes") == "0"
    )  # fetched, deleted


def test_any_server_takes_any_call(servers, undisturbed):
    first, second = servers("first"), servers("second")
    for server in (first, second):
        wait_for(server.is_ready)
    with stellate.Client(first.address) as one, stellate.Client(second.address) as other:
        name = one.create(manifolds.Torus(), EPSILON, worker_wait_seconds=PATIENCE).name
        waiting = other.create(manifolds.Torus(), EPSILON, worker_wait_seconds=PATIENCE).name
        assert other.get(name).state == one.get(name).state == "WAITING"
        for client in (one, other):
            wait_for(lambda client=client: {m.name for m in client.list()} == {name, waiting})
            assert {m.name for m in client.list(page_size=1)} == {name, waiting}
        assert other.serve(manifolds.Torus(), name) == "SUCCEEDED"
        for server in (first, second):
            made = stellate.download(name, server=server.address)
            assert made.points.tobytes() == undisturbed.points.tobytes()
            assert made.simplices.tobytes() == undisturbed.simplices.tobytes()
        assert one.cancel(waiting).state == "CANCELLED"
        one.delete(waiting)
        wait_for(lambda: {m.name for m in other.list()} == {name})
        for client in (one, other):
            with pytest.raises(stellate.MeshNotFound):
                client.get(waiting)
            with pytest.raises(stellate.MeshNotFound):
                client.get("meshes/" + 32 * "f")
    made = stellate.mesh(manifolds.Torus(), EPSILON, server=second.address)
    assert made.points.tobytes() == undisturbed.points.tobytes()


def declare(stub: pb_grpc.StellateStub, request: pb.CreateMeshRequest) -> str:
    """As a client does it: again while the server asks for that."""
    until = time.monotonic() + PATIENCE
    while True:
        try:
            return stub.CreateMesh(request, timeout=PATIENCE).name
        except grpc.RpcError as error:
            if error.code() is not grpc.StatusCode.UNAVAILABLE or time.monotonic() > until:
                raise


def test_a_mesh_is_declared_once_at_whichever_server(servers):
    pair = [servers("first"), servers("second")]
    for server in pair:
        wait_for(server.is_ready)
    with contextlib.ExitStack() as stack:
        stubs = [
            pb_grpc.StellateStub(stack.enter_context(grpc.insecure_channel(server.address)))
            for server in pair
        ]
        spec = mesh_pb2.MeshSpec(dimension=2, ambient_dimension=3, epsilon=0.3)
        spec.seeds.CopyFrom(to_wire(numpy.array([[1.0, 0.0, 0.0]])))
        for turn in range(8):
            request = pb.CreateMeshRequest(spec=spec, mesh_id=f"{turn:032x}")
            assert {declare(stub, request) for stub in stubs} == {"meshes/" + request.mesh_id}
        spec.epsilon = 0.2
        other = pb.CreateMeshRequest(spec=spec, mesh_id=32 * "0")
        for stub in stubs:
            with pytest.raises(grpc.RpcError, match="declared otherwise"):
                declare(stub, other)


def test_a_stopped_server_hands_its_meshes_over(servers, undisturbed, database):
    first, second = servers("first"), servers("second")
    for server in (first, second):
        wait_for(server.is_ready)
    made = Made(second.address)  # through the other, where it is not its own
    made.reach()
    with stellate.Client(first.address) as client:
        finished = client.create(manifolds.Torus(), EPSILON).name
        client.serve(manifolds.Torus(), finished)
    assert first.end(signal.SIGTERM) == 0
    with stellate.Client(second.address, reconnect_seconds=PATIENCE) as client:
        kept = stellate.download(finished, server=client)
    assert kept.points.tobytes() == undisturbed.points.tobytes()
    finish([made], undisturbed)
    assert sql(database, "SELECT count(*) FROM stellate.servers") == "1"


def test_a_frozen_server_changes_nothing_once_another_took_over(
    servers, front, undisturbed, database
):
    pair = [servers("first"), servers("second")]
    for server in pair:
        wait_for(server.is_ready)
    made = Made(front(*pair))
    made.reach()
    frozen = owner(pair, database)
    other = next(server for server in pair if server is not frozen)
    frozen.process.send_signal(signal.SIGSTOP)
    wait_for(lambda: running(database) == [other.address])
    finish([made], undisturbed)
    with stellate.Client(other.address) as client:
        kept = client.create(manifolds.Torus(), EPSILON).name
        client.serve(manifolds.Torus(), kept)
    rounds = "SELECT count(*) FROM stellate.records WHERE kind IN (3, 4)"
    wait_for(lambda: sql(database, rounds) == "0")  # the last that is removed
    records = sql(database, "SELECT count(*), sum(seal) FROM stellate.records")
    frozen.process.send_signal(signal.SIGCONT)
    wait_for(lambda: "is back" in frozen.log())
    wait_for(lambda: "goes on in another server" in frozen.log())
    assert sql(database, "SELECT count(*), sum(seal) FROM stellate.records") == records
    with stellate.Client(frozen.address, reconnect_seconds=PATIENCE) as client:
        assert [mesh.state for mesh in client.list()] == ["SUCCEEDED"]


def test_a_database_that_is_killed_moves_no_mesh(servers, undisturbed, database):
    pair = [servers("first"), servers("second")]
    for server in pair:
        wait_for(server.is_ready)
    with stellate.Client(pair[0].address) as client:
        client.create(manifolds.Torus(), EPSILON, worker_wait_seconds=PATIENCE)
    for _ in range(number("STELLATE_RESTARTS", 3)):
        meshes = [Made(server.address) for server in pair]
        for made in meshes:
            made.reach()
        control("stop", "-m", "immediate")
        for made in meshes:
            made.oracle.go.set()
        time.sleep(0.5)  # writes, which wait
        assert all(made.is_alive() for made in meshes)
        for server in pair:
            wait_for(lambda server=server: not server.sees_database())
        control("start")
        finish(meshes, undisturbed)
        for server in pair:
            wait_for(server.sees_database)
    assert sql(database, "SELECT epoch FROM stellate.meshes") == "1"
    for server in pair:
        assert "the database is back" in server.log()


def test_limits_of_an_owner_hold_on_all_servers(servers, tmp_path):
    tokens = tmp_path / "tokens"
    tokens.write_text("ada " + 40 * "a" + "\nbob " + 40 * "b" + "\n")
    tokens.chmod(0o600)
    pair = [servers(name, "--token-file", str(tokens), "--owner-meshes", "5") for name in "ab"]
    for server in pair:
        wait_for(server.is_ready)
    outcomes: list[str] = []

    def declare(server: Server) -> None:
        with stellate.Client(
            server.address, credentials=stellate.Credentials(token=40 * "a")
        ) as client:
            try:
                client.create(manifolds.Torus(), EPSILON, worker_wait_seconds=PATIENCE)
                outcomes.append("made")
            except stellate.LimitExceeded as error:
                assert "owner-meshes" in str(error)
                outcomes.append("refused")

    threads = [threading.Thread(target=declare, args=(pair[i % 2],)) for i in range(10)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE)
    assert sorted(outcomes) == 5 * ["made"] + 5 * ["refused"]
    with stellate.Client(pair[0].address, credentials=stellate.Credentials(token=40 * "a")) as ada:
        wait_for(lambda: len(list(ada.list())) == 5)  # once the servers have seen each other
        meshes = list(ada.list())
        ada.cancel(meshes[0].name)  # whichever server has it
        with stellate.Client(
            pair[1].address, credentials=stellate.Credentials(token=40 * "b")
        ) as bob:
            assert not list(bob.list())
            with pytest.raises(stellate.MeshNotFound):
                bob.get(meshes[0].name)
    wait_for(lambda: outcomes.append("again") or declare(pair[1]) or outcomes[-1] == "made")


def test_a_mesh_is_declared_once_it_is_recorded(servers, monkeypatch):
    monkeypatch.setitem(WAITS, "call", PATIENCE)
    server = servers("first")
    wait_for(server.is_ready)
    declared: list[str] = []

    def declare() -> None:
        with stellate.Client(server.address, reconnect_seconds=PATIENCE) as client:
            declared.append(client.create(manifolds.Torus(), EPSILON).name)

    control("stop", "-m", "immediate")
    try:
        thread = threading.Thread(target=declare, daemon=True)
        thread.start()
        wait_for(lambda: not server.sees_database())
        assert thread.is_alive() and not declared
    finally:
        control("start")
    thread.join(PATIENCE)
    assert len(declared) == 1
    server.end()  # a kill right after the reply takes nothing back
    server.start()
    wait_for(server.is_ready)
    with stellate.Client(server.address, reconnect_seconds=PATIENCE) as client:
        client.info()  # from now on it waits for what is away
        wait_for(lambda: [info.name for info in client.list()] == declared)  # once it was missed


def test_a_standby_of_the_database_takes_its_place(servers, undisturbed, database, tmp_path):
    """With a synchronous standby, promoted when the first is gone, nothing is lost and none moves."""
    words = shlex.split(os.environ["STELLATE_TEST_PG_CTL"])
    at = words.index("--pgdata")
    programs, folder = pathlib.Path(words[at - 1]).parent, pathlib.Path(words[at + 1]).parent
    standby = folder / "standby"

    def run(program: str, *arguments: str) -> None:
        command = [*words[: at - 1], str(programs / program), "--pgdata", str(standby), *arguments]
        subprocess.run(command, check=True, cwd=folder, stdout=subprocess.DEVNULL)

    origin = ["--host", str(folder), "--username", "stellate"]
    run("pg_basebackup", *origin, "--write-recovery-conf", "--checkpoint", "fast")
    steer = ["--wait", "--silent", "--log", str(standby / "log")]
    run("pg_ctl", *steer, "--options", "-c port=5433", "start")
    try:
        sql(database, "ALTER SYSTEM SET synchronous_standby_names = '*'")
        sql(database, "SELECT pg_reload_conf()")
        wait_for(lambda: sql(database, "SELECT sync_state FROM pg_stat_replication") == "sync")
        both = database.replace(f"host={folder}", f"host={folder},{folder}&port=5432,5433")
        (tmp_path / "url").write_text(both + "&target_session_attrs=read-write")
        server = servers("first")
        wait_for(server.is_ready)
        with stellate.Client(server.address) as client:
            client.create(manifolds.Torus(), EPSILON, worker_wait_seconds=PATIENCE)
        made = Made(server.address)
        made.reach()
        control("stop", "-m", "immediate")
        made.oracle.go.set()
        run("pg_ctl", *steer, "promote")
        finish([made], undisturbed)
        assert sql(f"{database}&port=5433", "SELECT epoch FROM stellate.meshes") == "1"
        assert server.end(signal.SIGTERM) == 0
    finally:
        run("pg_ctl", *steer, "stop", "-m", "immediate")
        shutil.rmtree(standby)
        control("start")
        sql(database, "ALTER SYSTEM RESET synchronous_standby_names")
        sql(database, "SELECT pg_reload_conf()")


def test_a_server_without_its_database_can_be_stopped(servers):
    server = servers("first")
    wait_for(server.is_ready)
    other = servers("second")
    wait_for(other.is_ready)
    made = Made(server.address)
    made.reach()
    control("stop", "-m", "immediate")
    try:
        made.oracle.go.set()
        time.sleep(0.5)
        assert server.end(signal.SIGTERM) == 0
        assert other.end(signal.SIGTERM) == 0
    finally:
        control("start")


def test_a_server_waits_for_a_database_that_is_not_there_yet(servers):
    control("stop", "-m", "immediate")
    try:
        first, second = servers("first"), servers("second")
        wait_for(lambda: "waiting for the database" in first.log())
        wait_for(lambda: "waiting for the database" in second.log())
        assert not first.sees_database() and not first.is_ready()
        assert second.end(signal.SIGTERM) == 0, "it can be stopped"
    finally:
        control("start")
    wait_for(first.is_ready)
    assert first.sees_database()
    with stellate.Client(first.address) as client:
        assert client.create(manifolds.Torus(), EPSILON).state == "WAITING"


def test_meshes_are_copied_into_a_database_and_out_of_it(servers, undisturbed, database, tmp_path):
    def copy(origin, target) -> str:
        command = [stellate.server.find_stellated(), "--copy-meshes", str(origin), str(target)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
        assert done.returncode == 0, done.stderr
        return done.stdout

    first, last = tmp_path / "first", tmp_path / "last"
    with stellate.Server("--data-dir", str(first)) as server, stellate.Client(server) as client:
        finished = client.create(manifolds.Torus(), EPSILON).name
        client.serve(manifolds.Torus(), finished)
        waiting = client.create(manifolds.Torus(), EPSILON, worker_wait_seconds=PATIENCE).name
    assert copy(first, tmp_path / "url").startswith("copied 2 meshes: ")
    assert copy(first, tmp_path / "url").endswith("2 were there already\n")
    server = servers("only")
    wait_for(server.is_ready)
    with stellate.Client(server.address) as client:
        kept = stellate.download(finished, server=client)
        assert kept.points.tobytes() == undisturbed.points.tobytes()
        assert client.serve(manifolds.Torus(), waiting) == "SUCCEEDED"
    assert server.end(signal.SIGTERM) == 0
    assert copy(tmp_path / "url", last).startswith("copied 2 meshes: ")
    with stellate.Server("--data-dir", str(last)) as server, stellate.Client(server) as client:
        kept = stellate.download(waiting, server=client)
        assert kept.points.tobytes() == undisturbed.points.tobytes()


def test_refusals(tmp_path):
    def refusal(*flags: str) -> str:
        command = [stellate.server.find_stellated(), "--listen", "127.0.0.1:0", *flags]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
        assert done.returncode == 2
        return done.stderr

    url = os.environ["STELLATE_TEST_DATABASE"]
    assert "give one of them" in refusal("--database", url, "--data-dir", str(tmp_path))
    assert "write the URL into a file" in refusal("--database", "postgresql://a:b@/c")
    nothing = refusal("--database", url.replace("/postgres?", "/nothing?"))
    assert "cannot be opened" in nothing and "does not exist" in nothing
    away = url.split("host=")[0] + f"host={tmp_path}"
    said = refusal("--database", away, "--database-patience", "0.1")
    assert "has not answered for" in said and "--database-patience" in said
