"""Oracles that are programs: what goes through the pipe, and what becomes of the processes."""

import os
import pickle
import shlex
import sys
import threading
import time

import numpy as np
import pytest
import stellate
from stellate import CommandOracle
from stellate._pipe import framing

TORUS = stellate.manifolds.Torus(1.0, 0.4)
X = np.random.default_rng(1).uniform(-1.2, 1.2, (200, 3))
BOX = "box=-1.5,-1.5,-0.5:1.5,1.5,0.5"

# An oracle of a torus in Python, of either framing, that leaves what it is told to out or does wrong.
PROGRAM = """
import os, struct, sys
import numpy as np
from stellate import ImplicitManifold
from stellate.manifolds import Torus
framing, act = sys.argv[1:]
flats = "flats" in act
def distance(x):
    return (np.hypot(np.hypot(x[:, 0], x[:, 1]) - 1, x[:, 2]) - 0.4)[:, None]
torus = Torus(1.0, 0.4) if not flats else ImplicitManifold(
    distance, None, ambient_dimension=3, dimension=2, bounding_box=([-1.5] * 3, [1.5] * 3))
print(f"stellate-oracle 1 {framing} k=2 d=3 tangents=1 flats={flats:d} {box}", flush=True)
source, sink = sys.stdin.buffer, sys.stdout.buffer
while True:
    if framing == "binary":
        head = source.read(16)
        if not head: break
        kind, n, wanted, _ = struct.unpack("=4I", head)
        x = np.frombuffer(source.read(24 * n)).reshape(n, 3)
        if kind == 2:
            bases = np.frombuffer(source.read(48 * n)).reshape(n, 3, 2)
            radii = np.frombuffer(source.read(8 * n))
    else:
        head = source.readline().split()
        if not head: break
        kind, n, wanted = 1, int(head[1]), int(head[2])
        x = np.array([source.readline().split() for _ in range(n)], dtype=float)
    y, found = (torus.intersect_flat(x, bases, radii) if kind == 2
                else (torus.closest_point(x), x[:, 2] < 0.9))
    t = torus.tangent_basis(y).reshape(n, 6)
    if act == "error": sink.write(struct.pack("=2I", 8, 8) + b"no licen" if framing == "binary"
                                  else b"error no licence\\n")
    elif framing == "binary":
        sink.write(struct.pack("=2I", n, 4 + (wanted & 1)) + y.tobytes())
        if wanted & 1: sink.write(t.tobytes())
        sink.write(found.astype("u1").tobytes())
    else:
        for row, is_found in zip(np.concatenate([y, t], axis=1), found):
            words = " ".join(map(repr, row.tolist())) if is_found else "-"
            sink.write(words.encode() + b"\\n")
    if act == "chatter": sink.write(b"and another thing\\n")
    sink.flush()
    if act == "once": break
    if act == "dies": print("out of paper", file=sys.stderr); sys.exit(3)
"""


@pytest.fixture
def program(tmp_path, repository):
    """The command of an oracle that answers and then acts."""
    path = tmp_path / "oracle.py"
    path.write_text(PROGRAM.replace("{box}", BOX))
    python = shlex.quote(sys.executable)
    package = shlex.quote(str(repository / "clients" / "python"))
    return lambda framing, act="well": f"PYTHONPATH={package} {python} {path} {framing} {act}"


@pytest.mark.parametrize("framing", ["binary", "text"])
def test_answers_are_the_program_s(program, framing):
    with CommandOracle(program(framing)) as oracle:
        assert (oracle.dimension, oracle.ambient_dimension) == (2, 3)
        assert oracle.bounding_box[1].tolist() == [1.5, 1.5, 0.5]
        assert not hasattr(oracle, "intersect_flat") and not hasattr(oracle, "local_size")
        for _ in range(2):  # tangents come along the second time
            with pytest.raises(stellate.NotConverged) as lost:
                oracle.closest_point(X)
            found = lost.value.converged
            assert (found == (X[:, 2] < 0.9)).all() and not found.all()
            y = lost.value.points[found]
            assert y.tobytes() == TORUS.closest_point(X[found]).tobytes()
            bases = oracle.tangent_basis(y)
            assert np.abs((bases * (X[found] - y)[:, :, None]).sum(axis=1)).max() < 1e-12
        assert oracle.closest_point(np.empty((0, 3))).shape == (0, 3)


def test_it_says_of_itself_what_its_first_line_says():
    told = "of radius 1,  k=2 at most"
    with CommandOracle(greeting(f"binary k=2 d=3 {BOX} about={told}")) as oracle:
        assert oracle.about == "of radius 1, k=2 at most"


def test_the_doctor_examines_it_as_any_other(program):
    with CommandOracle(program("text")) as oracle:
        assert stellate.check(oracle).ok


def test_flats_are_asked(program):
    with CommandOracle(program("binary", "flats")) as oracle:
        y = TORUS.closest_point(X)
        bases, radii = TORUS.tangent_basis(y), np.linalg.norm(X - y, axis=1) * 1.01
        radii[::2] *= 0.5
        there, found = oracle.intersect_flat(X, bases, radii)
        assert (found[1::2]).all() and not found[::2].any()
        assert np.abs(there - y)[1::2].max() < 1e-6


def test_processes_answer_side_by_side(program):
    with CommandOracle(program("binary"), processes=3) as oracle:
        answers, near = [None] * 6, X[X[:, 2] < 0.9]

        def ask(i):
            answers[i] = oracle.closest_point(near)

        threads = [threading.Thread(target=ask, args=(i,)) for i in range(6)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert all(answer.tobytes() == answers[0].tobytes() for answer in answers)
        assert len(oracle._running) == 3
    assert not oracle._running


def test_one_that_ends_after_a_batch_is_started_again(program):
    told = []
    with CommandOracle(program("binary", "once"), on_restart=told.append) as oracle:
        near = X[X[:, 2] < 0.9]
        first = oracle.closest_point(near)
        assert oracle.closest_point(near).tobytes() == first.tobytes()
        assert not told and len(oracle._running) == 1
    with CommandOracle(program("binary", "dies"), on_restart=told.append) as oracle:
        oracle.closest_point(near)
        oracle.closest_point(near)
    assert len(told) == 1 and "status 3" in told[0] and "out of paper" in told[0]


def greeting(words, then="cat >/dev/null"):
    return f"printf 'stellate-oracle 1 {words}\\n'; {then}"


FULL = f"binary k=2 d=3 {BOX}"
BATCH = 16 + 24 * len(X)
WRONG_BEGINNINGS = {
    "the oracle command is empty": ("", {}),
    "from 1 to 1024": ("true", {"processes": 0}),
    "must be positive": ("true", {"start_seconds": 0}),
    "what k is, neither": (greeting(f"binary d=3 {BOX}"), {}),
    "says k=2, and the options 1": (greeting(FULL), {"dimension": 1}),
    "k = 3 has to be": (greeting(f"binary k=3 d=3 {BOX}"), {}),
    "need d = 4 coordinates": (greeting(f"binary k=2 d=4 {BOX}"), {}),
    "neither box nor seeds": (greeting("binary k=2 d=3"), {}),
}
WRONG_COMMANDS = {
    "status 3": "exit 3",
    "that is not found": "no-such-program-as-this",
    "is 'Welcome'; if that is a banner": "echo Welcome",
    "'binary' or 'text' in third place": greeting("json"),
    "version '2'": "echo stellate-oracle 2 binary",
    "is none of k= d=": greeting("binary q=1"),
    "a whole number up to 1": greeting("binary tangents=yes"),
    "is not a box": greeting("binary box=1,1:0,0"),
    "is not a list of points": greeting("binary seeds=1,2;3"),
    "its first line never came": "sleep 60",
    "is 'Welcome'; if": "printf Welcome; exec sleep 60",  # without the end of a line
}
WRONG_ANSWERS = {
    "it closed its standard output, after it took 4816 of 4816 bytes": f"head -c {BATCH} >/dev/null",
    "read nor written for 0.3 seconds": "sleep 9",
    "does something else write": f"head -c {BATCH} >/dev/null; echo hello world",
    "it answers 7 rows and was asked 200": f"head -c {BATCH} >/dev/null; printf '\\7\\0\\0\\0\\0\\0\\0\\0'",
    "not finite": f"head -c {BATCH} >/dev/null; printf '\\310\\0\\0\\0\\0\\0\\0\\0'; "
    "yes '\\377' | tr -d '\\n' | tr '\\\\3-7' '\\377' | head -c 4800",
}


@pytest.mark.parametrize("words", WRONG_BEGINNINGS)
def test_options_that_make_no_sense_are_refused(words):
    command, options = WRONG_BEGINNINGS[words]
    with pytest.raises(stellate.InvalidArgument, match=words.replace("(", r"\(")):
        CommandOracle(command, **options)


@pytest.mark.parametrize("words", WRONG_COMMANDS)
def test_a_command_that_does_not_begin(words):
    command = WRONG_COMMANDS[words]
    with pytest.raises(stellate.OracleError) as error:
        CommandOracle(command, start_seconds=0.5 if command.startswith("sleep") else 30.0)
    assert words in str(error.value) and error.value.reason == "ORACLE_COMMAND"


def test_what_keeps_waiting_is_told(capfd):
    told = []
    more = {"on_waiting": told.append, "unremarked_seconds": 0.01}
    with pytest.raises(stellate.OracleError, match="its first line never came"):
        CommandOracle("exec sleep 60", start_seconds=0.3, **more)
    first = "waiting for the oracle command's first line, 0 s"
    assert set(told) == {first} and len(told) <= 5  # at .01, .02, .04, ... of .3 seconds
    told.clear()
    with CommandOracle(greeting(FULL, "exec sleep 60"), silence_seconds=0.3, **more) as oracle:
        with pytest.raises(stellate.OracleError, match="read nor written"):
            oracle.closest_point(X)
    answer = f"waiting for the oracle command's first answer, to {len(X)} closest points, 0 s"
    assert set(told) - {first} == {answer}
    with pytest.raises(stellate.OracleError, match="its first line never came"):
        CommandOracle("exec sleep 60", start_seconds=0.3, unremarked_seconds=0.1)
    assert f"stellate: {first}" in capfd.readouterr().err


@pytest.mark.parametrize("words", WRONG_ANSWERS)
def test_an_answer_that_is_none(words):
    seconds = 0.3 if "0.3" in words else 30.0
    with CommandOracle(greeting(FULL, WRONG_ANSWERS[words]), silence_seconds=seconds) as oracle:
        for _ in range(2):  # from then on the oracle has failed
            with pytest.raises(stellate.OracleError, match=words):
                oracle.closest_point(X)


# Seen with the answer, before the next batch, or in place of its answer.
CHATTER = "it wrote more|before it was asked|something else write|'and' for a number"


@pytest.mark.parametrize("framing", ["binary", "text"])
@pytest.mark.parametrize("act, words", [("error", "it says: "), ("chatter", CHATTER)])
def test_what_a_program_says_is_told(program, framing, act, words):
    with CommandOracle(program(framing, act)) as oracle:
        with pytest.raises(stellate.OracleError, match=words):
            oracle.closest_point(X[:1])
            oracle.closest_point(X[:1])


def alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_no_process_outlives_the_oracle(tmp_path):
    command = greeting(FULL, f"sleep 600 & echo $! >{tmp_path}/pid; trap '' TERM; wait")
    oracle = CommandOracle(command)
    while not (tmp_path / "pid").exists() or not (tmp_path / "pid").read_text():
        time.sleep(0.01)
    pid = int((tmp_path / "pid").read_text())
    assert alive(pid)
    oracle.close()
    oracle.close()
    for _ in range(500):
        if not alive(pid):
            break
        time.sleep(0.01)
    assert not alive(pid)
    with pytest.raises(stellate.OracleError, match="closed"):
        oracle.closest_point(X)


def test_a_pickle_starts_its_own(program):
    with CommandOracle(program("binary"), silence_seconds=50) as oracle:
        with pickle.loads(pickle.dumps(oracle)) as again:
            near = X[X[:, 2] < 0.9]
            assert again.closest_point(near).tobytes() == oracle.closest_point(near).tobytes()
            assert again._silence_seconds == 50


@pytest.mark.parametrize("number", [0.1, -1.5, 1e-20, 1 / 3, 1e300, 5e-324, 0.0, 1e22])
def test_numbers_of_text_are_exact_and_have_no_exponents(number):
    question = framing.Question(1, np.array([[number, 1.0]]))
    head, row = question.to_bytes(text=True).decode().splitlines()
    assert head == "closest 1 0 0" and "e" not in row
    assert float(row.split()[0]) == number


def test_text_comes_in_any_pieces():
    question = framing.Question(2, X[:3], tangents=True)
    lines = b"1 2 3 1 0 0 1 0 0\r\n -\n4e0 inf +6 0 1 1 0 0 0\n"
    for size in (1, 7, 100):
        reader, came = framing.reader(question, text=True), bytearray()
        done = False
        for at in range(0, len(lines), size):
            assert not done
            came += lines[at : at + size]
            done = reader.take(came)
        assert done and not came
    with pytest.raises(framing.Garbled, match="row 3 of 3 has a point that is not finite"):
        reader.finish()


@pytest.mark.parametrize(
    "rows, words",
    [
        (b"1 2 3\n1 2\n-\n", "row 2 of 3 has 2 numbers, and those before 3"),
        (b"1 2\n-\n-\n", "row 1 of 3 has 2 numbers, not 3 of a point"),
        (b"-\n1 2 x\n-\n", "row 2 of 3 has 'x' for a number"),
        (b"1 2 3\n1 2 3\n1 2 3\n", "it has no tangents"),
    ],
)
def test_wrong_text_is_told_by_its_row(rows, words):
    reader = framing.reader(framing.Question(2, X[:3], tangents="tangents" in words), text=True)
    assert reader.take(bytearray(rows))
    with pytest.raises(framing.Garbled, match=words):
        reader.finish()
