"""TLS, client certificates and tokens, from Python and from the command line."""

import os
import pathlib
import subprocess

import pytest
import stellate
from stellate import manifolds

ALICE = "alice-0123456789abcdef"


def openssl(directory, *arguments):
    subprocess.run(["openssl", *arguments], cwd=directory, check=True, capture_output=True)


def new_key(name):
    curve = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes")
    return (*curve, "-subj", f"/CN={name}", "-keyout", f"{name}.key")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """An authority, certificates of it for a server and a client, another authority, tokens."""
    directory = tmp_path_factory.mktemp("certificates")
    for authority in ("ca", "other"):
        openssl(directory, "req", "-x509", *new_key(authority), "-out", f"{authority}.pem")
    (directory / "names").write_text("subjectAltName=DNS:localhost,IP:127.0.0.1\n")
    for name in ("server", "client"):
        openssl(directory, "req", "-new", *new_key(name), "-out", f"{name}.csr")
        sign = ("-CA", "ca.pem", "-CAkey", "ca.key", "-set_serial", "1", "-extfile", "names")
        openssl(directory, "x509", "-req", "-in", f"{name}.csr", *sign, "-out", f"{name}.pem")
    (directory / "tokens").write_text(f"alice {ALICE}\n")
    (directory / "alice").write_text(ALICE + "\n")
    return directory


@pytest.fixture(scope="module")
def address(files):
    """A server that wants a client certificate and a token, on a port of the loopback."""
    command = [stellate.server.find_stellated(), "--listen", "127.0.0.1:0", "--log-level", "off"]
    command += ["--tls-cert", "server.pem", "--tls-key", "server.key", "--tls-client-ca", "ca.pem"]
    command += ["--token-file", "tokens", "--drain-seconds", "0"]
    with subprocess.Popen(command, cwd=files, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process.stdout.readline().split()[-1]
        finally:
            process.terminate()


@pytest.fixture
def full(files):
    return {
        "ca": files / "ca.pem",
        "certificate": files / "client.pem",
        "key": files / "client.key",
    }


def test_a_mesh_over_mutual_tls_with_a_token(address, full):
    credentials = stellate.Credentials(token=ALICE, **full)
    mesh = stellate.mesh(manifolds.Torus(), 0.2, server=address, credentials=credentials)
    assert mesh.certified


def test_health_under_mutual_tls(files, tmp_path):
    """The server's certificate is of another authority than its clients'."""
    program = stellate.server.find_stellated()
    server = ["--tls-cert", "server.pem", "--tls-key", "server.key", "--tls-client-ca", "other.pem"]
    command = [program, "--listen", "127.0.0.1:0", *server, "--ready-file", str(tmp_path / "ready")]
    with subprocess.Popen(command, cwd=files, stdout=subprocess.PIPE, text=True) as process:
        try:
            listen = ["--listen", process.stdout.readline().split()[-1]]
            ask = [program, "--health-check", *listen, *server]
            assert subprocess.run(ask, cwd=files, capture_output=True).returncode == 1
            ask += ["--health-cert", "other.pem", "--health-key", "other.key"]
            assert subprocess.run(ask, cwd=files).returncode == 0
        finally:
            process.terminate()


def test_health_where_no_authority_is_installed(files, tmp_path):
    """gRPC fails on roots that it cannot use, also where it is to verify nothing by them."""
    program = stellate.server.find_stellated()
    server = ["--tls-cert", "server.pem", "--tls-key", "server.key"]
    (tmp_path / "roots.pem").write_text("none")
    bare = {**os.environ, "GRPC_DEFAULT_SSL_ROOTS_FILE_PATH": str(tmp_path / "roots.pem")}
    command = [program, "--listen", "127.0.0.1:0", *server]
    with subprocess.Popen(command, cwd=files, stdout=subprocess.PIPE, text=True) as process:
        try:
            ask = [program, "--health-check", "--listen", process.stdout.readline().split()[-1]]
            assert subprocess.run([*ask, *server], cwd=files, env=bare).returncode == 0
            client = [pathlib.Path(program).with_name("stellate"), "health", "--tls", "--server"]
            said = subprocess.run([*client, ask[-1]], env=bare, capture_output=True, text=True)
            assert said.returncode == 3 and "install ca-certificates" in said.stderr
        finally:
            process.terminate()


def test_wrong_tokens_and_certificates_are_refused(address, files, full):
    for token in (None, "wrong-0123456789abcdef"):
        with stellate.Client(address, stellate.Credentials(token=token, **full)) as client:
            with pytest.raises(stellate.Unauthenticated):
                client.info()
    for wrong in (
        {"ca": files / "ca.pem"},  # no certificate
        {**full, "ca": files / "other.pem"},
        {**full, "certificate": files / "other.pem", "key": files / "other.key"},
    ):
        with stellate.Client(address, stellate.Credentials(token=ALICE, **wrong)) as client:
            with pytest.raises(stellate.Unavailable):
                client.info()


@pytest.fixture(scope="module")
def plain():
    with stellate.Server(listen="127.0.0.1:0") as server:
        yield server.address


def test_errors_name_what_helps(address, plain, files, full):
    """In Python and in the shell: each refusal with the words that name the flag."""
    tls = ("--tls-ca", "ca.pem", "--tls-cert", "client.pem", "--tls-key", "client.key")
    for server, credentials, flags, words, flag in (
        (address, {}, (), "want TLS", "--tls-ca FILE"),
        (address, {"ca": files / "ca.pem"}, tls[:2], "client certificate", "--tls-cert"),
        (address, {**full, "ca": files / "other.pem"}, ("--tls-ca", "other.pem", *tls[2:]),
         "no authority that is trusted", "--tls-ca FILE"),
        (address, full, tls, "give a token", "--token-file FILE"),
        (plain, full, tls, "speaks plain text", "--tls-ca"),
    ):  # fmt: skip
        with stellate.Client(server, stellate.Credentials(**credentials)) as client:
            with pytest.raises(stellate.StellateError, match=words) as refused:
                client.info()
        assert flag in str(refused.value)
        with pytest.raises(stellate.StellateError, match=words):
            stellate.serve(
                manifolds.Torus(), "meshes/" + "0" * 32, server=server,
                credentials=stellate.Credentials(**credentials),
            )  # fmt: skip
        program = pathlib.Path(stellate.server.find_stellated()).with_name("stellate")
        command = [program, "health", "--server", server, *flags]
        said = subprocess.run(command, cwd=files, capture_output=True, text=True)
        assert said.returncode in (2, 3) and words in said.stderr and flag in said.stderr


def test_tokens_are_kept_secret():
    assert ALICE not in repr(stellate.Credentials(token=ALICE))
    for server in ("example.org:7717", "127.evil.example:7717"):
        with pytest.raises(stellate.InvalidArgument, match="plain text"):
            stellate.Client(server, stellate.Credentials(token=ALICE))
    with pytest.raises(stellate.InvalidArgument):
        stellate.Client(None, stellate.Credentials(token=ALICE))


def test_the_command_line(address, files):
    program = pathlib.Path(stellate.server.find_stellated()).with_name("stellate")

    def run(*arguments):
        command = [program, *arguments, "--server", address]
        return subprocess.run(command, cwd=files, capture_output=True, text=True)

    tls = ("--tls-ca", "ca.pem", "--tls-cert", "client.pem", "--tls-key", "client.key")
    done = run("mesh", "torus", "-e", "0.2", *tls, "--token-file", "alice")
    assert done.returncode == 0, done.stderr
    assert run("health", *tls, "--token-file", "alice").returncode == 0
    refused = run("mesh", "torus", "-e", "0.2", *tls)
    assert refused.returncode == 2 and "UNAUTHENTICATED" in refused.stderr
    assert run("health", "--tls-ca", "ca.pem", "--token-file", "alice").returncode == 3
