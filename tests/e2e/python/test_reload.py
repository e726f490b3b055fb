"""SIGHUP has the configuration file read again, while the server runs."""

from __future__ import annotations

import concurrent.futures
import pathlib
import re
import signal
import subprocess

import pytest
import stellate


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "stellated.toml"
    path.write_text('listen = "127.0.0.1:0"\nmax-meshes = 5\nlog-level = "info"\n')
    return path


@pytest.fixture
def process(file):
    program = stellate.server.find_stellated()
    command = [program, "--config", str(file), "--max-rounds", "70"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True) as process:
        yield process
        process.terminate()
        process.stderr.read()


def told(process, words):
    """Tells the server to read the file, and returns its log up to a line with these words."""
    process.send_signal(signal.SIGHUP)
    log = ""
    while words not in log:
        line = process.stderr.readline()
        assert line, f"the server is gone: {log}"
        log += line
    return log


def test_limits_change_and_a_bad_file_changes_nothing(process, file):
    address = process.stdout.readline().split()[-1]
    with stellate.Client(address) as client:
        assert client.info().max_meshes == 5
        text = file.read_text()
        file.write_text(
            text.replace("= 5", "= 8") + "max-rounds = 60\nmax-connections = 9\ndrain-seconds = 0\n"
        )
        log = told(process, "read " + str(file))
        assert "max-meshes = 8" in log and "drain-seconds = 0" in log
        assert "max-connections was changed: that holds from the next start on" in log
        assert client.info().max_meshes == 8
        assert client.info().max_rounds == 70, "the command line comes first"

        for wrong, words in (
            ("max-meshes = many\n", '"many" but must be a whole number from 1 to 100000'),
            ("max-meshs = 9\n", 'there is no setting "max-meshs"'),
            ("max-meshes = 9\nowner-meshes = -1\n", '"-1" but must be'),
            ('max-meshes = 9\nlisten = "0.0.0.0:0"\n', "plain text"),
        ):
            file.write_text(wrong)
            log = told(process, "all settings stay as they were: " + str(file))
            assert words in log, log
            assert client.info().max_meshes == 8
        file.unlink()
        assert "not readable" in told(process, "all settings stay as they were")
        assert client.info().max_meshes == 8

        file.write_text(text.replace("= 5", "= 6"))
        assert "max-meshes = 6" in told(process, "read " + str(file))
        assert client.info().max_meshes == 6


def test_the_page_lists_what_can_change():
    page = (pathlib.Path(__file__).parents[3] / "docs/running/operations.md").read_text()
    section = page.split("**Without a restart.**")[1].split("A lower limit ends")[0]
    program = stellate.server.find_stellated()
    config = subprocess.run([program, "--print-config"], capture_output=True, text=True).stdout
    live = re.findall(r"(?m)^# .*\. SIGHUP reads it again\n([\w-]+) = ", config)
    assert live and sorted(re.findall(r"`([\w-]+)`[,\n]", section)) == sorted(live)


def test_weights_are_read_refused_and_read_again(tmp_path):
    tokens = {"ada": "ada-0123456789abcdef", "ben": "ben-0123456789abcdef"}
    file = tmp_path / "tokens"

    def weigh(ada):
        file.write_text(f"ada {tokens['ada']} weight={ada}\nben {tokens['ben']}\n")
        file.chmod(0o600)

    program = stellate.server.find_stellated()
    command = [program, "--listen", f"unix:{tmp_path}/s", "--token-file", str(file)]
    for wrong in ("0", "-3", "nan", "1e9", ""):
        weigh(wrong)
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 2
        assert "line 1 must have behind" in done.stderr and tokens["ada"] not in done.stderr
    weigh(3)
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        address = process.stdout.readline().split()[-1]
        alone = stellate.mesh(stellate.manifolds.Torus(), epsilon=0.3)

        def mesh(owner):
            with stellate.Client(address, stellate.Credentials(token=tokens[owner])) as client:
                return stellate.mesh(stellate.manifolds.Torus(), epsilon=0.3, server=client)

        weigh("0")
        assert "the tokens read before stay in force" in told(process, "weight=")
        weigh(1000)
        told(process, "2 tokens")
        with concurrent.futures.ThreadPoolExecutor() as pool:
            for made in pool.map(mesh, ["ada", "ben", "ada", "ben", "ben"]):
                assert (made.points == alone.points).all()
                assert (made.simplices == alone.simplices).all()
        process.terminate()
        process.stderr.read()
