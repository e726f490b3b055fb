"""What a page takes for granted: a source tree, programs on PATH, servers, certificates.

    plain      127.0.0.1:7717, plain text, metrics on 127.0.0.1:9717
    tls        mesh.example.org:7717, TLS by ca.pem, tokens: my-token holds one, $token is it

The runner has a network of its own where the system lets it: all ports are free then, and
mesh.example.org leads to this machine. Elsewhere it takes the machine's ports, one runner at a time,
and writes 127.0.0.2 for that name.
"""

from __future__ import annotations

import fcntl
import os
import pathlib
import re
import runpy
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from typing import Any

from blocks import ROOT, Page, Wrong
from session import Session

BUILD = pathlib.Path(os.environ.get("STELLATE_BUILD", ROOT / "build" / "release"))
PATIENCE = 100.0  # seconds: for a hang, not for a measurement
REMOTE, ADDRESS = "mesh.example.org", "127.0.0.2"
TOKEN = "0123456789abcdef" * 4
MAKE_MESH = str(pathlib.Path(__file__).resolve().parent / "make_mesh.py")
_ALONE = "STELLATE_DOCS_ALONE"
_OURS = ("STELLATED", "STELLATE")  # variables that name a program


def go_alone() -> None:
    """Starts this program again with a network and a view of /etc/hosts of its own, where it may."""
    if _ALONE not in os.environ:
        as_root = [] if os.geteuid() == 0 else ["--map-root-user"]
        inside = ["unshare", *as_root, "--net", "--mount"]
        if subprocess.run([*inside, "true"], capture_output=True).returncode == 0:
            os.environ[_ALONE] = "yes"
            os.execvp(inside[0], [*inside, sys.executable, "-B", *sys.argv])
        lock = open(pathlib.Path(tempfile.gettempdir()) / "stellate-docs.lock", "w")
        fcntl.flock(lock, fcntl.LOCK_EX)
        globals()["_lock"] = lock  # until the program ends
        return
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:  # the loopback, up
        request = struct.pack("16sh", b"lo", 1)
        fcntl.ioctl(control, 0x8914, request)  # SIOCSIFFLAGS, IFF_UP
    with tempfile.NamedTemporaryFile("w", prefix="hosts-") as hosts:
        hosts.write(f"127.0.0.1 localhost\n{ADDRESS} {REMOTE}\n")
        hosts.flush()
        subprocess.run(["mount", "--bind", hosts.name, "/etc/hosts"], check=True)


def is_alone() -> bool:
    """Whether the names of the docs lead here."""
    return _ALONE in os.environ


class Surroundings:
    """A scratch folder for one page, in which its blocks run one after the other."""

    def __init__(self, page: Page, folder: pathlib.Path) -> None:
        self.here = folder
        self._servers: list[subprocess.Popen] = []
        self._mesh: str | None = None
        self.in_session = page.table.get("session", False)
        self._session: Session | None = None
        self.paths = {}
        for path, name in page.table.get("paths", {}).items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            self.paths[path] = str(folder / name)
        self._service = page.table.get("service", False)
        # Of a fresh tree nothing is on PATH but what a page puts into the system.
        self._on_path = self._service or not page.table.get("fresh", False)
        self._grow_tree(fresh=page.table.get("fresh", False))
        if self._service:
            stand_in = pathlib.Path(__file__).resolve().parent / "systemctl"
            (folder / ".programs" / "systemctl").symlink_to(stand_in)
            for name in ("stellated.service", "stellated.toml"):  # they go into the scratch folder
                file = folder / "packaging" / name
                file.write_text(self.fill_in({}, file.read_text()))

    def _grow_tree(self, fresh: bool) -> None:
        # Scripts find the tree by their own place: what they lie in has to be a copy.
        # Stubs are made first, or somebody else's import may make them while they are copied.
        runpy.run_path(str(ROOT / "clients/python/stellate/_stubs.py"))["ensure"]()
        # Caches of linters that run beside this (.mypy_cache) come and go while they are copied.
        passing = shutil.ignore_patterns(
            "__pycache__", ".*_cache", ".generated-*", "node_modules", "target"
        )
        for item in ROOT.iterdir():
            if item.name in ("clients", "docker", "packaging", "proto"):
                shutil.copytree(item, self.here / item.name, symlinks=True, ignore=passing)
            elif item.name not in ("build", ".git"):
                (self.here / item.name).symlink_to(item)
        programs = self.here / ".programs"
        programs.mkdir()
        built = self.here / "build" / "release" / "bin"
        if self._on_path:
            for name in ("stellated", "stellate"):
                (programs / name).symlink_to(BUILD / "bin" / name)
        # Debian's python3, which has the packages that we ask for.
        (programs / "python3").symlink_to("/usr/bin/python3")
        if fresh:
            compiler = pathlib.Path(__file__).resolve().parent / "built_before"
            (programs / "cmake").symlink_to(compiler)
        else:
            built.parent.mkdir(parents=True)
            built.symlink_to(BUILD / "bin")

    def environment(self) -> dict[str, str]:
        """Of the blocks."""
        inherited = {name: value for name, value in os.environ.items() if name not in _OURS}
        return {
            **inherited,
            "PATH": f"{self.here}/.programs:{os.environ['PATH']}:/usr/sbin",
            "PYTHONPATH": f"{self.here}/clients/python:{self.here}/clients/conform",
            "PYTHONDONTWRITEBYTECODE": "1",
            "HOME": str(self.here),
            "TMPDIR": str(self.here),
            "MPLBACKEND": "Agg",
            **({"STELLATED": str(BUILD / "bin" / "stellated")} if self._on_path else {}),
            "STELLATE_BUILD": str(BUILD),
            "token": TOKEN,
            **({"here": str(self.here), "DESTDIR": f"{self.here}/root"} if self._service else {}),
        }

    def fill_in(self, entry: dict[str, Any], text: str) -> str:
        """A block's text without what stands for something else."""
        changes = {**self.paths, **entry.get("replace", {})}
        if not is_alone():
            changes[REMOTE] = ADDRESS
        changes["{mesh}"] = "{mesh}"
        # In one pass: what was filled in stays as it is.
        longest_first = sorted(changes, key=len, reverse=True)
        return re.sub(
            "|".join(map(re.escape, longest_first)), lambda m: self._value(changes[m[0]]), text
        )

    def _value(self, text: str) -> str:
        text = text.replace("{here}", str(self.here))
        return text.replace("{mesh}", self.mesh()) if "{mesh}" in text else text

    def start(self, names: list[str]) -> None:
        """Servers of the table above. They listen when this returns."""
        flags = {
            "plain": ["--listen=127.0.0.1:7717", "--metrics-listen=127.0.0.1:9717"],
            "tls": [f"--listen={ADDRESS}:7717",
                    "--tls-cert=server.pem", "--tls-key=server.key", "--token-file=tokens"],
        }  # fmt: skip
        self._mesh = None
        self._remote = "tls" in names
        if self._remote:
            self.certify()
        for name in names:
            if name not in flags:
                raise Wrong(f"there is no server {name!r}; there are {sorted(flags)}")
            log = (self.here / f".{name}.log").open("w")
            command = [str(BUILD / "bin" / "stellated"), *flags[name], "--ready-file=.ready"]
            (self.here / ".ready").unlink(missing_ok=True)
            server = subprocess.Popen(command, cwd=self.here, stdout=log, stderr=log)
            self._servers.append(server)
            end = time.monotonic() + PATIENCE
            while not (self.here / ".ready").exists():
                if server.poll() is not None or time.monotonic() > end:
                    raise Wrong(f"no server: {(self.here / f'.{name}.log').read_text()}")
                time.sleep(0.01)

    def stop(self) -> None:
        """Ends those servers."""
        for server in self._servers:
            server.kill()
            server.wait()
        self._servers.clear()

    def session(self) -> Session:
        """The page's interpreter, for pages of one."""
        if self._session is None:
            self._session = Session(str(self.here), self.environment(), PATIENCE)
        return self._session

    def close(self) -> None:
        """Ends what a page started as a service, and its interpreter."""
        if self._session is not None:
            self._session.close()
        try:
            os.kill(int((self.here / ".pid").read_text()), signal.SIGKILL)
        except (OSError, ValueError):
            pass  # none, or stopped

    def certify(self) -> None:
        """ca.pem; server.pem and server.key; me.pem and me.key; tokens, my-token."""

        def openssl(*arguments: str) -> None:
            subprocess.run(["openssl", *arguments], cwd=self.here, check=True, capture_output=True)

        def key(name: str) -> list[str]:
            return ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-noenc",
                    "-keyout", f"{name}.key", "-subj", f"/CN={name}"]  # fmt: skip

        openssl("req", "-x509", *key("ca"), "-days", "2", "-out", "ca.pem")
        names = self.here / ".names"
        names.write_text(f"subjectAltName=DNS:{REMOTE},IP:{ADDRESS}\n")
        for name in ("server", "me"):
            openssl("req", "-new", *key(name), "-out", f"{name}.csr")
            openssl("x509", "-req", "-in", f"{name}.csr", "-CA", "ca.pem", "-CAkey", "ca.key",
                    "-CAcreateserial", "-days", "2", "-extfile", str(names),
                    "-out", f"{name}.pem")  # fmt: skip
        shutil.copy(self.here / "ca.pem", self.here / "clients.pem")
        for name, text in (("tokens", f"me {TOKEN}\n"), ("my-token", f"{TOKEN}\n")):
            (self.here / name).write_text(text)
            (self.here / name).chmod(0o600)

    def mesh(self) -> str:
        """The name of a finished mesh on the server that was started."""
        if self._mesh is None:
            server = [ADDRESS, "ca.pem", TOKEN] if self._remote else ["127.0.0.1"]
            made = subprocess.run(
                ["python3", MAKE_MESH, *server], cwd=self.here,
                env=self.environment(), check=True, stdout=subprocess.PIPE, text=True,
            )  # fmt: skip
            self._mesh = made.stdout.strip()
        return self._mesh
