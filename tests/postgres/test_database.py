"""A database that is killed, replaced, not there yet, or not to be had."""

from __future__ import annotations

import os
import pathlib
import shlex
import shutil
import signal
import subprocess
import threading
import time

import cases
import pytest
import stellate
from servers import EPSILON, PATIENCE, Made, are_same, control, finish, sql, wait_for
from stellate import manifolds
from stellate._reconnect import WAITS


def test_a_database_that_is_killed_moves_no_mesh(cluster, undisturbed):
    cases.kill_database(cluster, undisturbed, 3)


def test_a_mesh_is_declared_once_it_is_recorded(cluster, monkeypatch):
    monkeypatch.setitem(WAITS, "call", PATIENCE)
    (server,) = cluster.ready("first")
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


def test_a_standby_of_the_database_takes_its_place(cluster, undisturbed, tmp_path):
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
        sql(cluster.database, "ALTER SYSTEM SET synchronous_standby_names = '*'")
        sql(cluster.database, "SELECT pg_reload_conf()")
        wait_for(
            lambda: sql(cluster.database, "SELECT sync_state FROM pg_stat_replication") == "sync"
        )
        both = cluster.database.replace(f"host={folder}", f"host={folder},{folder}&port=5432,5433")
        cluster.have_them_read(both + "&target_session_attrs=read-write")
        server = cluster.start("first")
        wait_for(server.is_ready)
        with stellate.Client(server.address) as client:
            client.create(manifolds.Torus(), EPSILON, worker_wait_seconds=PATIENCE)
        made = Made(server.address)
        made.reach()
        control("stop", "-m", "immediate")
        made.oracle.go.set()
        run("pg_ctl", *steer, "promote")
        finish([made], undisturbed)
        assert (
            sql(f"{cluster.database}&port=5433", "SELECT DISTINCT epoch FROM stellate.meshes")
            == "1"
        )
        assert server.end(signal.SIGTERM) == 0
    finally:
        run("pg_ctl", *steer, "stop", "-m", "immediate")
        shutil.rmtree(standby)
        control("start")
        sql(cluster.database, "ALTER SYSTEM RESET synchronous_standby_names")
        sql(cluster.database, "SELECT pg_reload_conf()")


def test_a_server_without_its_database_can_be_stopped(cluster):
    (server,) = cluster.ready("first")
    other = cluster.start("second")
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


def test_a_server_waits_for_a_database_that_is_not_there_yet(cluster):
    control("stop", "-m", "immediate")
    try:
        first, second = cluster.start("first"), cluster.start("second")
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


def test_probes_hear_of_a_database_that_is_away(cluster):
    (server,) = cluster.ready("first")
    wait_for(lambda: server.page("/healthz") == (200, "serving\n"))
    control("stop", "-m", "immediate")
    try:
        wait_for(lambda: server.page("/healthz")[0] == 503)
        assert "no new meshes are taken: the database does not answer" in server.page("/healthz")[1]
    finally:
        control("start")
    wait_for(lambda: server.page("/healthz")[0] == 200)


def test_settings_are_read_again_by_a_server_that_waits_for_its_database(cluster, tmp_path):
    settings = tmp_path / "stellated.toml"
    settings.write_text("max-meshes = 1\n")
    control("stop", "-m", "immediate")
    try:
        server = cluster.start("first", "--config", str(settings))
        wait_for(lambda: "waiting for the database" in server.log())
        assert server.page("/healthz") == (
            503,
            "no new meshes are taken: it waits for its database\n",
        )
        settings.write_text("max-meshes = 2\n")
        server.process.send_signal(signal.SIGHUP)
    finally:
        control("start")
    wait_for(server.is_ready)
    wait_for(lambda: "from now on max-meshes = 2" in server.log())
    with stellate.Client(server.address) as client:
        for _ in range(2):
            client.create(manifolds.Torus(), EPSILON, worker_wait_seconds=86400)
        with pytest.raises(stellate.LimitExceeded, match="max-meshes"):
            client.create(manifolds.Torus(), EPSILON, worker_wait_seconds=86400)


def test_meshes_are_copied_into_a_database_and_out_of_it(cluster, undisturbed, tmp_path):
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
    (server,) = cluster.ready("only")
    with stellate.Client(server.address) as client:
        kept = stellate.download(finished, server=client)
        assert are_same(kept, undisturbed)
        assert client.serve(manifolds.Torus(), waiting) == "SUCCEEDED"
    assert server.end(signal.SIGTERM) == 0
    assert copy(tmp_path / "url", last).startswith("copied 2 meshes: ")
    with stellate.Server("--data-dir", str(last)) as server, stellate.Client(server) as client:
        kept = stellate.download(waiting, server=client)
        assert are_same(kept, undisturbed)


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
