"""What is done to servers that share a database, as often as is asked for.

The tests do each a few times, the campaign by the thousand.
"""

from __future__ import annotations

import collections
import dataclasses
import faulthandler
import itertools
import random
import signal
import threading
import time

import stellate
from lossy_proxy import LossyProxy
from servers import (
    EPSILON,
    PATIENCE,
    Cluster,
    Made,
    Server,
    are_same,
    control,
    finish,
    sql,
    wait_for,
)
from stellate import manifolds


@dataclasses.dataclass(frozen=True)
class Takeover:
    """Seconds, by this machine's clock."""

    gaps: list[float]  # each mesh was asked nothing, at the longest
    missed: float  # from the end of the one server until the other replayed the first mesh
    replayed: float  # from then until it had replayed the last


def take_over(
    cluster: Cluster, expected: stellate.Mesh, meshes: int, how: signal.Signals
) -> Takeover:
    """Ends a server that has `meshes` under way: all end on the other, bit for bit."""
    (first,) = cluster.ready("first")
    second = cluster.add("second", "--log-format", "json")
    address = cluster.front(first, second)
    made = [Made(address) for _ in range(meshes)]
    for one in made:
        one.reach()
    second.start()
    wait_for(second.is_ready)
    ended, clock = time.monotonic(), time.time()
    first.end(how)
    finish(made, expected)
    gaps = [longest_gap([ended, *(t for t in one.oracle.asked if t > ended)]) for one in made]
    begun, done = second.logged("replaying"), second.logged("replayed; going on with new answers")
    return Takeover(gaps, min(begun) - clock, max(done) - min(begun))


def longest_gap(times: list[float]) -> float:
    return max(later - earlier for earlier, later in itertools.pairwise(times))


class Standing:
    """Meshes that nobody serves: they are there, whatever happens to servers."""

    def __init__(self, cluster: Cluster, address: str, count: int) -> None:
        self._cluster = cluster
        with stellate.Client(address) as client:
            self.names = sorted(
                client.create(manifolds.Torus(), EPSILON, worker_wait_seconds=86400).name
                for _ in range(count)
            )

    def check(self) -> None:
        """Once all servers are there, each has all in its list, and none of them twice."""
        for server in self._cluster.servers:
            wait_for(server.is_ready)
        orphans = (
            "SELECT count(*) FROM stellate.meshes WHERE server NOT IN "
            "(SELECT id FROM stellate.servers)"
        )
        silent = "SELECT count(*) FROM stellate.servers"
        wait_for(lambda: sql(self._cluster.database, silent) == str(len(self._cluster.servers)))
        wait_for(lambda: sql(self._cluster.database, orphans) == "0")
        for server in self._cluster.servers:
            wait_for(lambda server=server: self._listed_by(server) == self.names)

    def _listed_by(self, server: Server) -> list[str]:
        with stellate.Client(server.address, reconnect_seconds=PATIENCE) as client:
            counts = collections.Counter(mesh.name for mesh in client.list())
        twice = [name for name in self.names if counts[name] > 1]
        assert not twice, f"in two places: {twice}"
        return sorted(name for name in self.names if counts[name])

    def end(self, expected: stellate.Mesh) -> None:
        """Serves them at last."""
        self.check()
        for i, name in enumerate(self.names):
            address = self._cluster.servers[i % len(self._cluster.servers)].address
            with stellate.Client(address) as client:
                assert client.serve(manifolds.Torus(), name) == "SUCCEEDED"
                assert are_same(stellate.download(name, server=client), expected)
                client.delete(name)


class Stream(threading.Thread):
    """Makes one mesh after the other, until it is to stop."""

    def __init__(self, address: str, expected: stellate.Mesh) -> None:
        super().__init__(daemon=True)
        self._address, self._expected = address, expected
        self._ending = threading.Event()
        self.made = 0
        self.error: BaseException | None = None
        self.start()

    def run(self) -> None:
        try:
            with stellate.Client(self._address, reconnect_seconds=PATIENCE) as client:
                while not self._ending.wait(0.5):
                    mesh = stellate.mesh(manifolds.Torus(), EPSILON, server=client)
                    assert mesh.certified and are_same(mesh, self._expected), "another mesh"
                    self.made += 1
        except BaseException as error:  # shown by who waits for it
            self.error = error

    def end(self) -> int:
        self._ending.set()
        self.join(PATIENCE)
        assert self.error is None, self.error
        if self.is_alive():
            faulthandler.dump_traceback()  # where it hangs
            raise AssertionError("it does not end")
        return self.made


def come_and_go(
    cluster: Cluster,
    expected: stellate.Mesh,
    times: int,
    seed: int,
    *,
    streams: int = 2,
    standing: int = 4,
    longest_pause: float = 8.0,
    check_each: int = 25,
) -> int:
    """Kills and stops servers at random moments, one of three, and starts it again.

    Returns how many meshes were made meanwhile: each right, none of the standing ones lost or twice.
    """
    three = cluster.ready("first", "second", "third")
    address = cluster.front(*three)
    still = Standing(cluster, address, standing)
    under_way = [Stream(address, expected) for _ in range(streams)]
    draw = random.Random(seed)
    for turn in range(1, times + 1):
        time.sleep(draw.uniform(0, longest_pause))
        chosen = draw.choice(three)
        chosen.end(draw.choice([signal.SIGTERM, signal.SIGKILL]))
        chosen.start()
        for stream in under_way:
            assert stream.is_alive(), stream.error
        if turn % check_each == 0:
            still.check()
    still.check()
    made = sum(stream.end() for stream in under_way)
    still.end(expected)
    # Fetched, and deleted, but where a kill has undone that.
    left = "SELECT count(*) FROM stellate.meshes WHERE name IS NULL OR NOT ended"
    wait_for(lambda: sql(cluster.database, left) == "0")
    return made


def kill_database(cluster: Cluster, expected: stellate.Mesh, times: int) -> None:
    """Kills the database while two servers have something to record, and starts it again.

    No mesh moves: each goes on in its server.
    """
    pair = cluster.ready("first", "second")
    with stellate.Client(pair[0].address) as client:
        client.create(manifolds.Torus(), EPSILON, worker_wait_seconds=86400)
    for _ in range(times):
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
        finish(meshes, expected)
        for server in pair:
            wait_for(server.sees_database)
    assert sql(cluster.database, "SELECT DISTINCT epoch FROM stellate.meshes") == "1"
    for server in pair:
        assert "the database is back" in server.log()


def lose_replies(cluster: Cluster, times: int, at_once: int = 4) -> int:
    """Declares `times` meshes through proxies that lose every third reply, each by a new client.

    There are as many meshes then, and no more. Returns how many replies were lost.
    """
    (server,) = cluster.ready("only")
    errors: list[BaseException] = []
    lost: list[int] = []

    def declare(names: set[str], count: int) -> None:
        try:
            with LossyProxy(server.address, 3) as proxy:
                for _ in range(count):
                    with stellate.Client(proxy.address) as client:
                        info = client.create(manifolds.Torus(), EPSILON, worker_wait_seconds=86400)
                        names.add(info.name)
                lost.append(proxy.lost)
        except BaseException as error:
            errors.append(error)

    for begun in range(0, times, 48):  # of the 64 that a server runs at a time
        count = min(48, times - begun)
        names: set[str] = set()
        shares = [count // at_once + (i < count % at_once) for i in range(at_once)]
        threads = [threading.Thread(target=declare, args=(names, share)) for share in shares]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(PATIENCE * 4)
        assert not errors, errors
        assert len(names) == count
        there = sql(cluster.database, "SELECT count(*) FROM stellate.meshes WHERE NOT ended")
        assert there == str(count), f"{there} meshes of {count} declarations"
        with stellate.Client(server.address) as client:
            assert {mesh.name for mesh in client.list()} == names
            for name in names:
                client.delete(name)
        wait_for(lambda: sql(cluster.database, "SELECT count(*) FROM stellate.meshes") == "0")
    return sum(lost)


def declare_beyond(pair: list[Server], token: str, creations: int) -> tuple[int, int]:
    """An owner's creations at two servers at once: how many were made, and refused by the limit."""
    outcomes: list[str] = []

    def declare(server: Server) -> None:
        with stellate.Client(server.address, stellate.Credentials(token=token)) as client:
            try:
                client.create(manifolds.Torus(), EPSILON, worker_wait_seconds=86400)
                outcomes.append("made")
            except stellate.LimitExceeded as error:
                outcomes.append("refused" if "owner-meshes" in str(error) else str(error))
            except stellate.StellateError as error:
                outcomes.append(repr(error))

    threads = [threading.Thread(target=declare, args=(pair[i % 2],)) for i in range(creations)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE)
    counts = collections.Counter(outcomes)
    assert counts["made"] + counts["refused"] == creations, counts
    return counts["made"], counts["refused"]
