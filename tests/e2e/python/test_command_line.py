"""`python -m stellate`, as a user's shell runs it."""

import json
import os
import signal
import subprocess
import sys

import pytest
import stellate
from stellate import manifolds
from stellate._command_line import main
from stellate.viewer import find_stellate

SHAPES = """
import os, time
from stellate import manifolds

torus = manifolds.Torus()
so3 = manifolds.SpecialOrthogonal3

class Broken(manifolds.Torus):
    def closest_point(self, x):
        raise RuntimeError("the solver has no licence")

class Slow(manifolds.Torus):
    def closest_point(self, x):
        time.sleep(0.002 * len(x))
        return super().closest_point(x)

class Marking(manifolds.Torus):
    def closest_point(self, x):
        open(f"process-{os.getpid()}", "w").close()
        return super().closest_point(x)
"""


@pytest.fixture
def shell(tmp_path, repository):
    """Starts the command line in a folder with shapes.py, and waits for its end."""
    (tmp_path / "shapes.py").write_text(SHAPES)
    client = str(repository / "clients" / "python")
    environment = {**os.environ, "PYTHONPATH": client, "PYTHONFAULTHANDLER": "1"}

    def run(*arguments, wait=True, **more):
        running = subprocess.Popen(
            [sys.executable, "-m", "stellate", *map(str, arguments)], cwd=tmp_path,
            env={**environment, **more}, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        return ended(running) if wait else running

    return run


def ended(running, seconds=300):
    """What a command has printed when it ends. One that hangs shows where all its threads are."""
    try:
        output, complaints = running.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        running.send_signal(signal.SIGABRT)
        pytest.fail(f"{running.args} hangs:\n{running.communicate(timeout=20)}")
    return subprocess.CompletedProcess(running.args, running.returncode, output, complaints)


def test_mesh_writes_what_was_asked_for(shell, tmp_path):
    done = shell(
        "mesh", "shapes:torus", "-e", "0.3", "-o", "a.txt", "-o", "a.stl", "--report", "a.json",
        "--max-rounds", "1000", "--no-speculative", "--seed", "1",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "CERTIFIED" in done.stdout and "vertices" in done.stderr
    same = stellate.mesh(manifolds.Torus(), 0.3, speculative=False)
    assert stellate.load_txt(tmp_path / "a.txt").points.tobytes() == same.points.tobytes()
    assert (tmp_path / "a.stl").stat().st_size == 84 + 50 * len(same.simplices)
    assert json.loads((tmp_path / "a.json").read_text())["certificate"]


def test_an_uncertified_mesh_exits_one(shell):
    done = shell("mesh", "shapes:torus", "-e", "0.2", "--max-vertices", "50", "--json", "-q")
    assert done.returncode == 1, done.stderr
    assert json.loads(done.stdout)["termination"] == "VERTEX_BUDGET"


def test_ctrl_c_keeps_what_there_is(shell, tmp_path):
    command = ["mesh", "shapes:Slow", "-e", "0.05", "-o", "part.txt"]
    running = shell(*command, wait=False)
    for line in running.stderr:
        if "refining" in line:
            break
    running.send_signal(signal.SIGINT)
    stopped = ended(running)
    assert stopped.returncode == 1, stopped.stderr
    assert "NOT CERTIFIED" in stopped.stdout and "Traceback" not in stopped.stderr
    assert len(stellate.load_txt(tmp_path / "part.txt").points) > 0


def test_declare_serve_and_download(shell, server, tmp_path):
    at = ("--server", server.address)
    name = shell("declare", "shapes:torus", "-e", "0.3", "--label", "mine", *at).stdout.strip()
    with stellate.Client(server) as client:
        assert client.get(name).label == "mine" and client.get(name).state == "WAITING"
    early = shell("download", name, "-o", "a.txt", *at)
    assert early.returncode == 2 and "not over" in early.stderr
    served = shell("serve", "shapes:Marking", name, "--processes", "2", *at)
    assert (served.returncode, served.stdout) == (0, "SUCCEEDED\n"), served.stderr
    assert list(tmp_path.glob("process-*"))
    late = shell("serve", "shapes:torus", name, *at)
    assert (late.returncode, late.stdout) == (0, "SUCCEEDED\n"), late.stderr
    done = shell("download", name, "-o", "a.txt", "-o", "a.msh", "-q", *at)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    assert (tmp_path / "a.txt").exists() and (tmp_path / "a.msh").exists()


def perl(repository):
    return f"perl {repository / 'clients' / 'pipe' / 'torus.pl'}"


def test_a_program_s_manifold_is_meshed(shell, repository, tmp_path):
    command, torus = ["--oracle-command", perl(repository)], manifolds.Torus(1.0, 0.4)
    box = ":".join(",".join(map(repr, corner.tolist())) for corner in torus.bounding_box)
    done = shell("mesh", *command, f"--box={box}", "-e", "0.2", "-o", "a.txt",
                 "--oracle-processes", "2", "-q")  # fmt: skip
    assert done.returncode == 0, done.stderr
    same = stellate.mesh(torus, 0.2)
    mesh = stellate.load_txt(tmp_path / "a.txt")
    assert (len(mesh.points), len(mesh.simplices)) == (len(same.points), len(same.simplices))
    doctor = shell("doctor", *command)
    assert doctor.returncode == 0, doctor.stdout
    wrong = shell("mesh", *command, "-k", "1", "-e", "0.3")
    assert wrong.returncode == 2 and "the options 1" in wrong.stderr
    broken = shell("mesh", "--oracle-command", "echo hello", "-e", "0.3")
    assert broken.returncode == 3 and "is 'hello'; if that is a banner" in broken.stderr


def test_programs_serve_what_was_declared(shell, server, repository):
    at = ("--server", server.address)
    command = ("--oracle-command", perl(repository))
    name = shell("declare", *command, "-e", "0.3", *at).stdout.strip()
    with stellate.Client(server) as client:
        assert client.get(name).label == perl(repository)[:128]
    served = shell("serve", name, *command, "--oracle-processes", "2", *at)
    assert (served.returncode, served.stdout) == (0, "SUCCEEDED\n"), served.stderr


def test_a_mesh_is_kept_on_its_server(shell, server, tmp_path):
    at = ("--server", server.address)
    done = shell("mesh", "shapes:torus", "-e", "0.3", "-q", "--keep", "-o", "a.txt", *at)
    assert done.returncode == 0 and "it stays on" in done.stderr, done.stderr
    again = stellate.download(done.stderr.split()[-1], server=server)
    kept = stellate.load_txt(tmp_path / "a.txt")
    assert again.points.tobytes() == kept.points.tobytes()
    alone = shell("mesh", "shapes:torus", "-e", "0.3", "-q", "--keep")
    assert alone.returncode == 2 and "a private one ends" in alone.stderr


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["mesh", "shapes:torus", "--oracle-command", "x", "-e", "0.3"], "either shapes:torus or"),
        (["mesh", "-e", "0.3"], "or give --oracle-command"),
        (["mesh", "shapes:torus", "-k", "2", "-e", "0.3"], "--dimension goes with"),
        (["mesh", "--oracle-command", "x", "--box", "1:0", "-e", "1"], "is not a box"),
        (["mesh", "shapes:absent", "-e", "0.3"], "has no attribute 'absent'"),
        (["mesh", "shapes", "-e", "0.3"], "MODULE:OBJECT"),
        (["mesh", "shapes.py:ring", "-e", "0.3"], "goes without .py, as shapes:ring"),
        (["mesh", "absent:torus", "-e", "0.3"], "No module named 'absent'"),
        (["mesh", "shapes:torus"], "--epsilon"),
        (["mesh", "shapes:torus", "-e", "fine"], "length or auto"),
        (["mesh", "shapes:torus", "-e", "-1"], "INVALID_ARGUMENT"),
        (["mesh", "shapes:torus", "-e", "0.3", "--shape", "good"], "--shape 'good' is for k = 3"),
        (["mesh", "shapes:torus", "-e", "0.3", "--advance-step", "0.1"], ": --advance-step is 0.1"),
        (["mesh", "shapes:torus", "-e", "0.3", "--reach", "-1"], ": --reach is -1"),
        (["download", "meshes/1", "-o", "a.txt", "--revision", "0"], "number from 1 on"),
        (["mesh", "shapes:so3", "-e", "0.4", "-o", "so3.stl"], "surfaces"),
        (["mesh", "shapes:torus", "-e", "0.3", "-o", "no/such.txt"], "there is no folder"),
        (["serve", "shapes:torus", "meshes/" + 32 * "0"], "MESH_NOT_FOUND"),
        (["download", "meshes/" + 32 * "0", "-o", "a.txt"], "MESH_NOT_FOUND"),
        (["frobnicate"], "invalid choice"),
    ],
)
def test_refusals_exit_two(arguments, words, shell, server, tmp_path, monkeypatch, capsys):
    # In this process, as test_help. `shell` has written shapes.py.
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    at = ["--server", server.address] if arguments[0] != "frobnicate" else []
    try:
        status = main([*arguments, *at])
    except SystemExit as refused:
        status = refused.code
    assert status == 2 and words in capsys.readouterr().err


def test_failures_exit_three(shell):
    broken = shell("mesh", "shapes:Broken", "-e", "0.3", "-q")
    assert broken.returncode == 3
    assert "has no licence" in broken.stderr and "shapes.py" in broken.stderr  # where it was
    gone = shell("mesh", "shapes:torus", "-e", "0.3", "--server", "unix:/nowhere/at/all")
    assert gone.returncode == 3 and "stellate: UNAVAILABLE: " in gone.stderr


def test_tokens_come_from_a_file_or_the_environment(shell, tmp_path):
    token = "alice-0123456789abcdef"
    (tmp_path / "tokens").write_text(f"alice {token}\n")
    (tmp_path / "mine").write_text(token + "\n")
    with stellate.Server(listen="127.0.0.1:0", token_file=tmp_path / "tokens") as server:
        mesh = ("mesh", "shapes:torus", "-e", "0.3", "-q", "--server", server.address)
        refused = shell(*mesh)
        assert refused.returncode == 2 and "--token-file" in refused.stderr
        assert shell(*mesh, "--token-file", "mine").returncode == 0
        assert shell(*mesh, STELLATE_TOKEN=token).returncode == 0
        (tmp_path / "two").write_text(f"alice {token}\n")
        assert "one token and nothing else" in shell(*mesh, "--token-file", "two").stderr


def test_help(shell, capsys):
    whole = shell("--help")
    assert whole.returncode == 0 and "MODULE:OBJECT" in whole.stdout
    for command in ("mesh", "declare", "serve", "download", "doctor"):
        assert command in whole.stdout
        # In this process: another would have to import it all again.
        with pytest.raises(SystemExit) as ended:
            main([command, "--help"])
        assert ended.value.code == 0
        assert f"stellate {command}" in capsys.readouterr().out


def test_declaring_takes_nothing_that_only_serving_needs(shell):
    for flag in ("--workers", "--max-chunk"):
        refused = shell("declare", "shapes:circle", "-e", "0.5", flag, "2")
        assert refused.returncode == 2 and f"unrecognized arguments: {flag}" in refused.stderr
    with pytest.raises(TypeError, match="'workers' is for who serves the mesh"):
        with stellate.Client() as client:
            client.create(stellate.manifolds.Sphere(1), 0.5, workers=2)


@pytest.mark.parametrize("where", ["no such folder", "x" * 120])
def test_a_socket_goes_elsewhere_than_where_it_cannot_be(where, tmp_path):
    """$TMPDIR that is not there, or too long for the kernel's 107 bytes."""
    folder = tmp_path / where
    if " " not in where:
        folder.mkdir()
    ran = subprocess.run(
        [find_stellate(), "mesh", "sphere", "-e", "0.5", "-q"],
        env={**os.environ, "TMPDIR": str(folder)}, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
