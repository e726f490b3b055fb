"""`stellate conform`: the C++ and the Python client pass, and what is wrong with others is found."""

import json
import os
import pathlib
import subprocess
import sys

import pytest
from stellate._generated import oracle_pb2
from stellate._wire.arrays import from_wire
from stellate_conform.recorder import read_session

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
ENVIRONMENT = {
    **os.environ,
    "PYTHONPATH": f"{ROOT}/clients/python:{ROOT}/clients/conform",
    "PYTHONWARNINGS": "ignore",
    "PATH": f"{pathlib.Path(sys.executable).parent}:{os.environ['PATH']}",
}
PYTHON_CLIENT = (sys.executable, str(HERE / "python_client.py"))
FAULTY_CLIENT = (sys.executable, str(HERE / "faulty_client.py"))


KIT = (sys.executable, "-m", "stellate_conform")


def start(*arguments, kit=KIT):
    command = [*kit, "--json", *arguments]
    return subprocess.Popen(command, env=ENVIRONMENT, stdout=subprocess.PIPE, text=True)


def verdicts(process, status=0):
    out, _ = process.communicate(timeout=240)
    said = json.loads(out)
    failed = [rule for rule in said["rules"] if rule["verdict"] == "FAIL"]
    assert process.returncode == status, failed
    return said


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """The kit on both clients, at once: most of it is waiting."""
    record = tmp_path_factory.mktemp("sessions") / "python.session"
    cpp = os.environ["STELLATE_CPP_CLIENT"]
    return {
        "python": start("--record", str(record), "--", *PYTHON_CLIENT),
        "cpp": start(
            "--", cpp, kit=(os.environ["STELLATE"], "conform")
        ),  # handed over by the command line
        "faultless": start("worker", "points", "--", *FAULTY_CLIENT, "none"),
        "record": record,
    }


@pytest.mark.parametrize("client", ["python", "cpp"])
def test_an_official_client_obeys_every_rule(runs, client):
    said = verdicts(runs[client])
    assert said["failed"] == said["untried"] == 0
    assert said["passed"] > 150


def test_a_recorded_session_is_enough_to_test_a_worker(runs):
    """The questions of a session, answered without a server: the answers are those recorded."""
    from python_client import named
    from stellate._worker import answer
    from stellate.oracle import CheckedOracle

    runs["python"].wait()
    manifolds, asked, same = {}, {}, 0
    for message in read_session(runs["record"]):
        if message.method != "ServeOracle" or message.WhichOneof("content") != "message":
            continue
        if not message.from_client:
            said = oracle_pb2.ServeOracleResponse.FromString(message.message)
            if said.WhichOneof("message") == "welcome":
                manifolds[message.call] = (said.welcome.dimension, said.welcome.ambient_dimension)
            asked[message.call, said.queries.lease] = said.queries
            continue
        reply = oracle_pb2.ServeOracleRequest.FromString(message.message)
        if reply.WhichOneof("message") != "answers" or manifolds[message.call] != (2, 4):
            continue
        oracle = CheckedOracle(named("clifford"))
        ours = answer(oracle, asked[message.call, reply.answers.lease])
        assert ours == reply
        same += len(from_wire(ours.answers.points, -1, 4))
    assert same > 1000


def test_a_client_without_a_fault_passes(runs):
    assert verdicts(runs["faultless"])["passed"] > 30


FAULTS = [
    ("no-hello", "worker.one-row", "worker.hello-first"),
    ("other-mesh", "worker.hello-first", "worker.hello-first"),
    ("no-lease", "worker.one-row", "worker.one-row"),
    ("answers-twice", "worker.one-row", "worker.many-rows"),
    ("columns-first", "clifford", "worker.clifford.one-row"),
    ("keeps-its-half", "worker.one-row", "worker.ends-its-half-with-the-mesh"),
    ("finds-all", "half", "worker.half.found-and-not"),
    ("no-sign", "lune", "worker.lune.clearances"),
    ("inwards", "lune", "worker.lune.first-wall"),
    ("walls-descend", "lune", "worker.lune.corner"),
    ("any-walls", "other-walls", "worker.other-walls-are-refused"),
    ("fails-in-silence", "tells", "worker.tells-of-its-failure"),
    ("comes-back", "bad-answer", "worker.bad-answer.stays-away"),
    ("gives-up", "server-stops", "worker.server-stops.comes-back"),
    ("silent", "says-busy", "worker.slow.says-busy"),
    ("always-busy", "no-busy", "worker.no-busy-to-an-old-server"),
    ("starts-over", "server-stops", "points.server-stops.goes-on-from-what-is-recorded"),
    ("digest-of-the-rest", "server-stops", "points.server-stops.sends-the-end-again"),
    ("single-precision", "unchanged", "points.points-unchanged"),
    ("one-chunk", "unchanged", "points.chunks-follow-each-other"),
    ("sends-again", "wrong-row", "points.wrong-row.stays-away"),
]


@pytest.mark.parametrize("fault, only, found", FAULTS, ids=[fault for fault, _, _ in FAULTS])
def test_a_fault_is_found(fault, only, found):
    # The worker's faults may leave it waiting for ever; all uploads come to an end.
    patience = "60" if found.startswith("points") else "6"
    options = ("worker", "points", "--only", only, "--patience", patience, "--")
    bad = verdicts(start(*options, *FAULTY_CLIENT, fault), status=1)
    failed = {rule["rule"]: rule for rule in bad["rules"] if rule["verdict"] == "FAIL"}
    assert found in failed
    assert failed[found]["came"]


@pytest.mark.parametrize(
    "arguments, words",
    [
        (("nobody", "--", "true"), "'nobody' has to be one of"),
        (("--", "no-such-program"), "no-such-program"),
        ((), "no COMMAND is given"),
        (("--listen", "nowhere", "--", "true"), "nowhere"),
    ],
)
def test_what_makes_no_sense_is_refused(arguments, words):
    done = subprocess.run(
        [*KIT, *arguments],
        env=ENVIRONMENT,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 2
    assert words in done.stderr
    assert "Traceback" not in done.stderr


def test_a_client_that_dies_fails_what_is_left():
    said = verdicts(start("creator", "--", "true"), status=1)
    assert said["passed"] == 0 and said["failed"] > 10


def test_a_python_that_lacks_what_the_kit_imports_is_passed_over(tmp_path):
    bare = tmp_path / "python3"
    bare.write_text(f'#!/bin/sh\nexec {sys.executable} -S "$@"\n')  # no site-packages: no grpc
    bare.chmod(0o755)
    done = subprocess.run(
        [os.environ["STELLATE"], "conform", "--help"],
        env={**ENVIRONMENT, "PATH": str(tmp_path)}, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("usage: stellate-conform")


def test_without_the_package_the_command_line_says_how_to_get_it(tmp_path):
    nowhere = {"PATH": str(tmp_path), "PYTHONNOUSERSITE": "1", "PYTHONPATH": ""}
    done = subprocess.run(
        [os.environ["STELLATE"], "conform", "--help"],
        env=nowhere, cwd=tmp_path, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 3
    assert done.stderr.count("\n") == 1 and "pip install" in done.stderr
    for folder in ("clients/python", "clients/conform"):
        assert f"./{folder}" in done.stderr and (ROOT / folder / "pyproject.toml").is_file()
