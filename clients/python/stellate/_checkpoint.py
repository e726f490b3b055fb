"""A directory in which one mesh outlives the processes that make it."""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import fcntl
import hashlib
import json
import os
import shutil
import stat
import time
import zipfile
from typing import IO, Any, Callable

import numpy as np
from google.protobuf.json_format import MessageToDict

from ._epsilon import AUTO, Epsilon, choose
from ._findings import CheckReport
from ._generated import mesh_pb2 as pb
from ._mesh import FinishedMesh
from ._shared import table
from .errors import FailedPrecondition, InvalidArgument
from .report import Progress, Report

_NAMES = table("checkpoint.toml")
_LAYOUT = 1  # of the files
_LAST_SERVER_SECONDS = 60.0  # it has been asked to stop, and may be busy with a round


class Checkpoint:
    """The directory while one process works in it. A context manager.

    lock        held by that process
    mesh.json   what is meshed, and its name on the private server
    server/     that server's --data-dir, until the mesh is finished
    mesh.npz    the finished mesh, and the digest of what was meshed

    Only what this user put there is read, and no link is followed.

    Raises, when entered: FailedPrecondition if another process is at work in it, InvalidArgument if
    others could have written there, OSError.
    """

    def __init__(self, directory: str | os.PathLike[str], part: str | None = None) -> None:
        """`part`: which part of the oracle's manifold is meshed (`keep` of stellate.mesh), where the
        specification does not tell."""
        self._part = part
        self.directory = os.fspath(directory).rstrip("/") or "/"  # "link/" would be followed
        self._server_directory = os.path.join(self.directory, _NAMES["server"])
        self._record_path = os.path.join(self.directory, _NAMES["python_record"])
        self._mesh_path = os.path.join(self.directory, "mesh.npz")
        self._record: dict[str, Any] = {}
        self._lock: IO[str] | None = None

    def __enter__(self) -> Checkpoint:
        try:
            os.makedirs(self.directory, mode=0o700, exist_ok=True)
        except FileExistsError:
            raise InvalidArgument(
                f"checkpoint has to be a directory, and {self.directory} is a file"
            ) from None
        _insist_on_own(self.directory)
        lock = _open_own(os.path.join(self.directory, "lock"), os.O_RDWR | os.O_CREAT)
        self._lock = os.fdopen(lock, "r+")
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._lock.close()
            raise FailedPrecondition(
                f"another process is meshing in the checkpoint {self.directory}: wait for its end, "
                "or take another directory"
            ) from None
        try:
            self._record = self._read()
        except BaseException:
            self._lock.close()
            raise
        return self

    def __exit__(self, *raised: object) -> None:
        assert self._lock is not None
        self._lock.close()

    def server_flags(self) -> tuple[str, ...]:
        """For the private server, once that of a killed process has come to its end."""
        deadline = time.monotonic() + _LAST_SERVER_SECONDS
        lock = os.path.join(self._server_directory, "lock")  # as stellated has it
        while os.path.exists(lock):
            with os.fdopen(_open_own(lock, os.O_RDONLY)) as file:
                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                except BlockingIOError:
                    pass
            if time.monotonic() > deadline:
                raise FailedPrecondition(
                    f"the server of an earlier call still uses {self._server_directory}: end it"
                )
            time.sleep(0.05)
        return "--data-dir", self._server_directory

    @property
    def name(self) -> str:
        """The mesh's name on the private server; "" if none was made yet."""
        return self._record.get("name", "")

    def choose_epsilon(
        self,
        oracle: Any,
        epsilon: Epsilon,
        check: Callable[[Any], CheckReport],
        tell: Callable[[str], None],
    ) -> tuple[float, str]:
        """As _epsilon.choose, which is asked for "auto" only once."""
        if epsilon == AUTO and self._record.get("epsilon_reason"):
            return self._record["spec"]["epsilon"], self._record["epsilon_reason"]
        return choose(oracle, epsilon, check, tell)

    @property
    def retries(self) -> int | None:
        """How often the mesh that is there may be followed by a finer one; None: there is none."""
        return self._record.get("retries")

    def require(self, spec: pb.MeshSpec) -> None:
        """Raises InvalidArgument if this is the directory of a mesh of another specification."""
        if not self._record:
            return
        part = self._record.get("keep")
        if self._record["digest"] != _digest(spec) or part != self._part:
            differences = _differences(
                {**self._record["spec"], "keep": part}, {**_plain(spec), "keep": self._part}
            )
            raise InvalidArgument(
                f"the checkpoint {self.directory} is of a mesh of another specification: "
                f"{'; '.join(differences) or 'by its digest'}. Take another directory, or remove it"
            )

    def note(self, spec: pb.MeshSpec, name: str, epsilon_reason: str, retries: int) -> None:
        """Puts down what is meshed, before it is."""
        self._record = {
            "layout": _LAYOUT,
            "name": name,
            "digest": _digest(spec),
            "epsilon_reason": epsilon_reason,
            "retries": retries,
            "spec": _plain(spec),
            "keep": self._part,
        }
        text = json.dumps(self._record, indent=1) + "\n"
        self._replace(self._record_path, lambda file: file.write(text.encode()))

    def forget(self) -> None:
        """The next call begins from the start."""
        os.remove(self._record_path)
        self._record = {}

    def finished(self, spec: pb.MeshSpec) -> FinishedMesh | None:
        """The mesh, if it is finished. Raises InvalidArgument if it is of another specification."""
        try:
            file = os.fdopen(_open_own(self._mesh_path, os.O_RDONLY), "rb")
        except FileNotFoundError:
            return None
        try:
            with file, np.load(file, allow_pickle=False) as kept:
                points, simplices = kept["points"], kept["simplices"]
                walls = kept["walls"] if "walls" in kept else None
                labels = kept["labels"] if "labels" in kept else None
                about = json.loads(str(kept["about"]))
            if about["digest"] != _digest(spec):
                raise ValueError("its digest is of another specification")
            # Those of earlier versions lack the last rule.
            standing: dict[str, Any] = {"bad_protection": 0, **(about["progress"] or {})}
            progress = about["progress"] and Progress(**standing)
            report = Report.from_fields(about["report"])
            return FinishedMesh(
                points,
                simplices,
                report,
                progress,
                about["revision"],
                walls,
                labels=labels,
                region_names=tuple(spec.region_names),
                scale=tuple(spec.scale),
            )
        except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
            raise InvalidArgument(
                f"{self._mesh_path} is no mesh that was kept ({error}): remove {self.directory}"
            ) from error

    def keep(self, mesh: FinishedMesh) -> None:
        """Keeps a finished mesh, which needs its server no more."""
        about = {
            "report": dataclasses.asdict(mesh.report),
            "progress": mesh.progress and dataclasses.asdict(mesh.progress),
            "revision": mesh.revision,
            "digest": self._record["digest"],
        }
        arrays = {"points": mesh.points, "simplices": mesh.simplices}
        if mesh.walls is not None:
            arrays["walls"] = mesh.walls
        if mesh.labels is not None:
            arrays["labels"] = mesh.labels
        self._replace(
            self._mesh_path,
            lambda file: np.savez(file, about=np.array(json.dumps(about)), **arrays),
        )

    def forget_server(self) -> None:
        """Removes what the server of a finished mesh has left."""
        shutil.rmtree(self._server_directory, ignore_errors=True)

    def _read(self) -> dict[str, Any]:
        try:
            with os.fdopen(_open_own(self._record_path, os.O_RDONLY)) as file:
                record = json.load(file)
            if record["layout"] == _LAYOUT and record["name"] and record["digest"]:
                return record
            problem = f"layout {record['layout']}"
        except FileNotFoundError:
            return {}
        except (ValueError, KeyError, TypeError) as error:
            problem = str(error)
        raise InvalidArgument(
            f"{self._record_path} is no record of this version's ({problem}): take another "
            f"directory, or remove {self.directory}"
        )

    def _replace(self, path: str, write: Callable[[IO[bytes]], object]) -> None:
        """The whole file or none of it, also when the machine goes down."""
        new = path + ".new"
        with contextlib.suppress(FileNotFoundError):
            os.remove(new)  # of a process that was killed; a link itself, not where it leads
        with os.fdopen(_open_own(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL), "wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(new, path)
        directory = os.open(self.directory, os.O_RDONLY)
        try:
            os.fsync(directory)
        finally:
            os.close(directory)


def _insist_on_own(directory: str) -> None:
    """Raises InvalidArgument where others could have put there what we would believe."""
    found = os.lstat(directory)
    if stat.S_ISLNK(found.st_mode):
        problem = "is a link: name the directory that it leads to"
    elif found.st_uid != os.geteuid():
        problem = f"belongs to another user, of number {found.st_uid}: take another directory"
    elif found.st_mode & 0o022:
        problem = (
            f"may be written by others (mode {stat.S_IMODE(found.st_mode):04o}): take another "
            "directory, or, if all in it is yours, chmod go-w"
        )
    else:
        return
    raise InvalidArgument(f"the checkpoint {directory} {problem}")


def _open_own(path: str, flags: int) -> int:
    """A file of this user's, no link and no pipe. Raises InvalidArgument, or OSError as os.open."""
    try:
        # NONBLOCK: a pipe without another end would wait for it.
        file = os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, mode=0o600)
    except OSError as error:
        if error.errno in (errno.ELOOP, errno.EMLINK):
            raise InvalidArgument(f"{path} is a link, which no checkpoint has: remove it") from None
        raise
    found = os.fstat(file)
    if stat.S_ISREG(found.st_mode) and found.st_uid == os.geteuid():
        return file
    os.close(file)
    raise InvalidArgument(f"{path} is no file of this user's: take another directory")


def _essence(spec: pb.MeshSpec) -> pb.MeshSpec:
    """What determines the mesh."""
    copy = pb.MeshSpec()
    copy.CopyFrom(spec)
    copy.ClearField("label")
    copy.oracle.ClearField("about")
    return copy


def _plain(spec: pb.MeshSpec) -> dict[str, Any]:
    return MessageToDict(_essence(spec), preserving_proto_field_name=True)


def _digest(spec: pb.MeshSpec) -> str:
    return hashlib.sha256(_essence(spec).SerializeToString(deterministic=True)).hexdigest()


def _differences(there: dict[str, Any], here: dict[str, Any], within: str = "") -> list[str]:
    found = []
    for name in {**there, **here}:
        a, b = there.get(name), here.get(name)
        if a == b:
            continue
        either = a if isinstance(a, dict) else b
        if isinstance(either, dict) and "data" not in either:
            found += _differences(a or {}, b or {}, f"{within}{name}.")
        elif isinstance(either, dict):  # an array
            found.append(f"{within}{name} differs")
        else:
            there_it, here_it = ("not given" if x is None else x for x in (a, b))
            found.append(f"{within}{name} is {there_it} there and {here_it} here")
    return found
