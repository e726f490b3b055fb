"""`stellate doctor --listen`: oracles of workers, which come as to a server."""

import contextlib
import json
import pathlib
import re
import resource
import socket
import struct
import subprocess
import time

import pytest
import stellate
from stellate.manifolds import ProductOfCircles, Sphere, Torus
from stellate.oracles import Clipped, HalfSpace, Solid

STELLATE = pathlib.Path(stellate.server.find_stellated()).parent / "stellate"


@contextlib.contextmanager
def doctor(*flags, **options):
    """The process, and a client of it."""
    command = [STELLATE, "doctor", "--listen", "127.0.0.1:0", "--exit-with-parent", *flags]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, **options) as process:
        try:
            said, _, address = process.stdout.readline().strip().rpartition(" ")
            assert said == "stellate doctor listening on"
            with stellate.Client(address) as client:
                yield process, client
        finally:
            process.terminate()


def examine(client, oracle, epsilon):
    name = client.create(oracle, epsilon).name
    return client.serve(oracle, name)


class Moving(Torus):
    def closest_point(self, x):
        return 1.01 * super().closest_point(x)


class Raising(Torus):
    def closest_point(self, x):
        raise ArithmeticError("no such surface")


def test_others_than_this_machine_come_over_tls_alone():
    for flags in ["0.0.0.0:0"], ["[::]:0"], ["127.0.0.1:0", "--tls-cert", "a.pem"]:
        done = subprocess.run(
            [STELLATE, "doctor", "--listen", *flags], capture_output=True, text=True, timeout=60
        )
        assert done.returncode == 2, done
        assert "--tls-key" in done.stderr
        assert done.stdout == ""


def frame(kind, flags, stream, payload=b""):
    """Of HTTP/2."""
    return (
        struct.pack(">I", len(payload))[1:]
        + bytes([kind, flags])
        + struct.pack(">I", stream)
        + payload
    )


def header(name, value):
    """Without a table or Huffman's code."""
    return b"\0" + bytes([len(name)]) + name.encode() + bytes([len(value)]) + value.encode()


CREATE_MESH = b"".join(
    header(*field)
    for field in (
        (":method", "POST"),
        (":scheme", "http"),
        (":path", "/stellate.v1.Stellate/CreateMesh"),
        (":authority", "doctor"),
        ("content-type", "application/grpc"),
        ("te", "trailers"),
    )
)
SETTINGS, PING, WINDOW = 4, 6, 8
INITIAL_WINDOW = 4  # among the settings


def send_unfinished(stranger, streams, size):
    """Requests of `size` bytes that lack their last one, as fast as the windows allow.
    ConnectionError when the server hangs up."""
    left = {stream: size + 4 for stream in range(1, 2 * streams, 2)}
    windows, initial = {0: 65535, **dict.fromkeys(left, 65535)}, 65535
    # Their lengths, and zeros.
    begins = {stream: struct.pack(">BI", 0, size) for stream in left}
    stranger.sendall(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + frame(SETTINGS, 0, 0))
    for stream in left:
        stranger.sendall(frame(1, 4, stream, CREATE_MESH))
    incoming = stranger.makefile("rb")
    while True:
        for stream in left:
            while (n := min(16384, left[stream], windows[stream], windows[0])) > 0:
                body = begins.pop(stream, b"").ljust(n, b"\0")
                stranger.sendall(frame(0, 0, stream, body))
                for counted in left, windows:
                    counted[stream] -= n
                windows[0] -= n
        if not any(left.values()):
            return
        head = incoming.read(9)
        if len(head) < 9:
            raise ConnectionResetError
        payload = incoming.read(int.from_bytes(head[:3], "big"))
        kind, flags, stream = head[3], head[4], int.from_bytes(head[5:], "big")
        if kind == WINDOW:
            windows[stream] = windows.get(stream, 0) + int.from_bytes(payload, "big")
        elif kind == SETTINGS and not flags:
            for setting, value in struct.iter_unpack(">HI", payload):
                if setting == INITIAL_WINDOW:
                    for other in left:
                        windows[other] += value - initial
                    initial = value
            stranger.sendall(frame(SETTINGS, 1, 0))
        elif kind == PING and not flags:
            stranger.sendall(frame(PING, 1, 0, payload))


# 64 requests of 4 MB each, 5 of 60 MB each: more than 250 MB, if they were kept.
@pytest.mark.parametrize(("streams", "size"), [(64, 4 << 20), (5, 60 << 20)])
def test_requests_that_never_become_whole_are_not_kept(streams, size):
    with doctor() as (process, client):
        host, port = client.address.rsplit(":", 1)
        with (
            socket.create_connection((host, int(port)), 60) as stranger,
            pytest.raises(ConnectionError),
        ):
            send_unfinished(stranger, streams, size - 64)
        status = pathlib.Path(f"/proc/{process.pid}/status").read_text()
        peak = int(status.split("VmHWM:")[1].split()[0]) >> 10
        assert peak < 150, f"{peak} MB"
        assert examine(client, Torus(), 0.01) == "SUCCEEDED"


def test_what_it_says_of_its_bounds_names_no_flag_that_it_lacks(tmp_path):
    log = tmp_path / "log"

    def few_files():
        resource.setrlimit(resource.RLIMIT_NOFILE, (200, 200))

    with log.open("w") as file, doctor(stderr=file, preexec_fn=few_files) as (process, client):
        host, port = client.address.rsplit(":", 1)

        def await_said(what):
            while what not in log.read_text():
                assert process.poll() is None, log.read_text()
                time.sleep(0.05)

        await_said("files: it serves")
        with contextlib.ExitStack() as strangers:

            def stranger():
                return strangers.enter_context(socket.create_connection((host, int(port)), 60))

            with pytest.raises(ConnectionError):
                send_unfinished(stranger(), 64, (4 << 20) - 64)
            await_said("unfinished requests")
            for _ in range(64):  # say nothing
                stranger()
            await_said("that had not said hello")
            while "the most that" not in log.read_text():
                assert process.poll() is None, log.read_text()
                polite = stranger()
                with contextlib.suppress(ConnectionError):
                    polite.sendall(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + frame(SETTINGS, 0, 0))
                    polite.recv(1)
    known = subprocess.run([STELLATE, "doctor", "--help"], capture_output=True, text=True).stdout
    for flag in re.findall(r"--[a-z-]+", log.read_text()):
        assert flag in known, log.read_text()


def test_finds_what_the_doctor_beside_the_oracle_finds():
    with doctor("--json") as (process, client):
        for oracle in Torus(), ProductOfCircles(), Sphere():
            assert examine(client, oracle, 0.01) == "SUCCEEDED"
        process.terminate()
        text = process.stdout.read()
    assert process.wait() == 0
    decoder, reports = json.JSONDecoder(), []
    while text.strip():
        report, end = decoder.raw_decode(text.lstrip())
        reports.append(report)
        text = text.lstrip()[end:]
    for report, oracle in zip(reports, [Torus(), ProductOfCircles(), Sphere()], strict=True):
        own = stellate.check(oracle, 0.01)
        assert report["ok"] and own.ok, report["text"]
        assert report["reach"] == pytest.approx(own.reach, rel=0.05)
        assert report["pieces"] == own.pieces
        assert report["epsilon"] == pytest.approx(own.reach / 4, rel=0.1)
        codes = {finding["code"] for finding in report["findings"]}
        assert codes == {finding.code for finding in own.findings}


def test_oracles_that_break_their_contract():
    with doctor() as (process, client):
        assert examine(client, Moving(), 0.1) == "SUCCEEDED"
        with pytest.raises(ArithmeticError, match="no such surface"):
            examine(client, Raising(), 0.1)
        name = client.create(Torus(), 0.1).name
        client.delete(name)
        with pytest.raises(stellate.MeshNotFound):
            client.serve(Torus(), name)
        process.terminate()
        text = " ".join(process.stdout.read().split())
    assert process.wait() == 1
    assert "error NOT_IDEMPOTENT: closest_point moves its own answer" in text
    assert "error RAISED: ClosestPoint failed on a batch of 400: ArithmeticError: no such" in text


def half_a_sphere():
    return Clipped(Sphere(), [HalfSpace([0, 0, 1], -0.1)])


class Inward(Clipped):
    def conormals(self, points, face):
        return -super().conormals(points, face)


class Afield(Clipped):
    def face_point(self, points, face):
        return super().face_point(points, face) + 0.01


WALLED = [
    half_a_sphere(),
    Solid(ball=([0, 0, 0], 1)),
    Inward(Sphere(), [HalfSpace([0, 0, 1], -0.1)]),
    Afield(Sphere(), [HalfSpace([0, 0, 1], -0.1)]),
    Clipped(Sphere(), [HalfSpace([0, 0, 1], 5)]),
    Clipped(half_a_sphere(), [HalfSpace([0, 0.2, 1], -0.1)]),
    Clipped(half_a_sphere(), [HalfSpace([0, 0, 1], -5)]),
    Solid([HalfSpace([0, 1, 0]), HalfSpace([0.5, -(0.75**0.5), 0])], ball=([0, 0, 0], 1)),
]
OF_WALLS = [
    set(),
    set(),
    {"CONORMAL_INWARD"},
    {"FACE_OFF_MANIFOLD"},
    {"NOTHING_LEFT"},
    {"WALLS_TANGENTIAL"},
    {"WALL_CUTS_NOTHING"},
    {"ACUTE_EDGE"},
]


@pytest.mark.parametrize("oracle, expected", zip(WALLED, OF_WALLS, strict=True))
def test_walls_are_examined_as_beside_the_oracle(oracle, expected):
    with doctor("--json") as (process, client):
        assert examine(client, oracle, 0.05) == "SUCCEEDED"
        process.terminate()
        report = json.loads(process.stdout.read())
    codes = {finding["code"] for finding in report["findings"]}
    assert expected <= codes, report["text"]
    own = stellate.check(oracle, 0.05)
    of_walls = ("WALL", "FACE", "CONORMAL", "ACUTE", "NOTHING_LEFT")
    assert {code for code in codes if code.startswith(of_walls)} == {
        code for code in own.codes if code.startswith(of_walls)
    }
    assert report["ok"] == own.ok
    if own.reach is not None:
        assert report["reach"] == pytest.approx(own.reach, rel=0.2)


def test_a_worker_that_goes_leaves_a_report():
    class Leaving(Torus):
        def closest_point(self, x):
            client.close()
            return super().closest_point(x)

    with doctor() as (process, client):
        with pytest.raises(Exception):  # noqa: B017 - gRPC's own, of a channel that was closed
            examine(client, Leaving(), 0.1)
        assert "the worker went away before it had answered" in process.stdout.readline()
