"""Workers whose oracle runs on the processes or machines of a concurrent.futures.Executor."""

from __future__ import annotations

import collections
import concurrent.futures as futures
import dataclasses
import logging
import pickle
import threading
import traceback
import uuid
from typing import Any, Callable

from ._credentials import Credentials
from ._generated import oracle_pb2 as pb
from ._interrupt import told
from ._worker import answer, join_all
from .client import Client
from .errors import ExecutorError, InvalidArgument, OracleError
from .oracle import CheckedOracle
from .server import Server

__all__ = ["ExecutorWorkers", "workers_on"]

MakeExecutor = Callable[[], futures.Executor]

_ATTEMPTS = 3  # at one chunk, before its slot gives up
_ORACLES_KEPT = 8

_log = logging.getLogger("stellate")


# What runs on the executor ------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class _Raised:
    """What an oracle raised. A result, so that it is never taken for a failure of the executor."""

    error: Exception
    trace: str


_oracles: collections.OrderedDict[str, CheckedOracle] = collections.OrderedDict()
_oracles_lock = threading.Lock()


def _checked(key: str, oracle: Any) -> CheckedOracle:
    """The same object for a key as last time, as far as this process remembers.

    So an oracle may keep what was expensive to make: a licence, a solver, a connection.
    """
    with _oracles_lock:
        if key not in _oracles:
            _oracles[key] = CheckedOracle(oracle)
        _oracles.move_to_end(key)
        while len(_oracles) > _ORACLES_KEPT:
            _oracles.popitem(last=False)
        return _oracles[key]


def _answer_here(key: str, oracle: Any, chunk: bytes) -> bytes | _Raised:
    """One chunk's answers, both in the protocol's bytes."""
    try:
        reply = answer(_checked(key, oracle), pb.QueryChunk.FromString(chunk))
        return reply.SerializeToString()
    except Exception as error:
        return _Raised(_portable(error), traceback.format_exc())


def _portable(error: Exception) -> Exception:
    """The error if another process can read it, else its words."""
    try:
        if str(pickle.loads(pickle.dumps(error))) == str(error):
            return error
    except Exception:  # whatever its class may do
        pass
    words = traceback.format_exception_only(type(error), error)[-1].strip()
    return OracleError(words, getattr(error, "reason", None))


# What runs here -----------------------------------------------------------------------------------


class _Pool:
    """An executor, or, where a function makes them, a new one for each that broke."""

    def __init__(self, executor: futures.Executor | MakeExecutor) -> None:
        self._lock = threading.Lock()
        self._make: MakeExecutor | None = None
        if isinstance(executor, futures.Executor):
            self._executor = executor
        else:
            self._make = executor
            self._executor = executor()

    def get(self) -> futures.Executor:
        with self._lock:
            return self._executor

    def replace(self, broken: futures.Executor) -> bool:
        """Whether there is another executor in the place of a broken one."""
        with self._lock:
            if self._make is None:
                return False
            if self._executor is broken:  # else another slot was first
                _log.warning("the executor broke: making another")
                broken.shutdown(wait=False)
                self._executor = self._make()
            return True

    def close(self) -> None:
        if self._make is not None:
            self.get().shutdown(wait=False)


class _Left(ExecutorError):
    """stop() was called."""


class ExecutorWorkers:
    """Workers of one mesh on an executor; see workers_on. A context manager: leaving stops them."""

    def __init__(
        self,
        executor: futures.Executor | MakeExecutor,
        oracle: Any,
        mesh_name: str,
        slots: int,
        server: str | Server | Client,
        credentials: Credentials | None,
        worker: str,
        max_chunk: int | None,
    ) -> None:
        if int(slots) != slots or slots < 1:
            raise ValueError(f"slots has to be a whole number from 1 on, and is {slots!r}")
        self._oracle, self._checked, self._key = oracle, CheckedOracle(oracle), uuid.uuid4().hex
        self._stopped: futures.Future[None] = futures.Future()
        self._failure: BaseException | None = None  # the oracle's first
        self._lost: BaseException | None = None  # the first of a slot that ended without the mesh
        self._states = [""] * int(slots)
        self._lock = threading.Lock()
        if isinstance(server, Client) and credentials is not None:
            raise InvalidArgument("a Client has its credentials already: give it them")
        self._own_client: Client | None = None
        if not isinstance(server, Client):
            server = self._own_client = Client(server, credentials)
        self._pool = _Pool(executor)
        self._workers = [
            server.worker(
                self._checked,
                mesh_name,
                f"{worker}-{i}",
                self._note,
                quiet=i > 1,
                ask=self._ask,
                max_chunk=max_chunk,
            )  # fmt: skip
            for i in range(1, int(slots) + 1)
        ]
        self._left = len(self._workers)
        self._threads = [
            threading.Thread(target=self._run, args=(i,), name=f"slot-{i + 1}", daemon=True)
            for i in range(len(self._workers))
        ]
        for thread in self._threads:
            thread.start()

    def wait(self, timeout: float | None = None) -> list[str]:
        """Waits for the mesh's end. Ctrl-C takes the workers away: Interrupted.

        Returns: for each slot the state that the mesh ended in, "" for one that left before.
        Raises: what the oracle raised; where no slot saw the end, why the first of them left, such
          as ExecutorError; TimeoutError after `timeout` seconds, and the workers go on.
        """
        try:
            with told("the workers left; the mesh waits for others"):
                ended = join_all(self._threads, timeout)
        except BaseException:
            self.stop()
            raise
        if not ended:
            raise TimeoutError(f"the mesh was not over after {timeout} s")
        if self._failure is not None:
            raise self._failure
        if self._lost is not None and not any(self._states):
            raise self._lost
        return list(self._states)

    def stop(self) -> None:
        """Takes the workers away; what they have not answered goes to others. May be called again.

        A chunk that the executor is at is not waited for.
        """
        with self._lock:
            if not self._stopped.done():
                self._stopped.set_result(None)
        for worker in self._workers:
            worker.stop()

    def __enter__(self) -> ExecutorWorkers:
        return self

    def __exit__(self, *raised: object) -> None:
        self.stop()
        for thread in self._threads:
            thread.join()

    def _run(self, slot: int) -> None:
        try:
            self._states[slot] = self._workers[slot].run()
        except _Left:
            pass
        except BaseException as error:
            if error is not self._failure:
                _log.warning("slot %d left the mesh: %s", slot + 1, error)
                self._lost = self._lost or error
        finally:
            with self._lock:
                self._left -= 1
                last = self._left == 0
            if last:
                self._pool.close()
                if self._own_client is not None:
                    self._own_client.close()

    def _note(self, error: BaseException) -> None:
        self._failure = self._failure or error

    def _ask(self, oracle: CheckedOracle, chunk: pb.QueryChunk) -> pb.ServeOracleRequest:
        """The executor's answers to a chunk. Raises: what the oracle does, ExecutorError."""
        question = chunk.SerializeToString()
        for attempt in range(_ATTEMPTS):
            executor = self._pool.get()
            try:
                result = self._result_of(executor, question)
                break
            except _Left:
                raise
            except Exception as error:
                self._after(error, executor, attempt)
        if isinstance(result, _Raised):
            raise result.error from OracleError(f"in the executor:\n{result.trace}")
        return pb.ServeOracleRequest.FromString(result)

    def _result_of(self, executor: futures.Executor, question: bytes) -> bytes | _Raised:
        future = executor.submit(_answer_here, self._key, self._oracle, question)
        either: list[futures.Future[Any]] = [future, self._stopped]
        futures.wait(either, return_when=futures.FIRST_COMPLETED)
        if self._stopped.done():
            future.cancel()
            raise _Left("the workers were stopped")
        return future.result()

    def _after(self, error: Exception, executor: futures.Executor, attempt: int) -> None:
        """Returns when a chunk that the executor lost is worth another attempt."""
        words = f"{type(error).__name__}: {error}"
        if (
            isinstance(error, (pickle.PicklingError, AttributeError, TypeError))
            and "pickle" in words
        ):
            raise ExecutorError(
                f"the oracle cannot be sent to the executor's processes ({words}): they are sent what "
                "pickle can write. Give it functions that a module defines by def, no lambda and none "
                "within another function, and nothing open, such as a file or a lock"
            ) from error
        if isinstance(error, futures.BrokenExecutor) and not self._pool.replace(executor):
            raise ExecutorError(
                f"the executor broke ({words}): one of its processes died, of a signal or for want "
                "of memory perhaps, or could not import the oracle. The mesh waits for other "
                "workers: call workers_on again with a new executor, or give it a function that "
                "makes executors"
            ) from error
        if attempt + 1 == _ATTEMPTS:
            raise ExecutorError(
                f"the executor lost a chunk of questions {_ATTEMPTS} times, at last by {words}"
            ) from error


def workers_on(
    executor: futures.Executor | MakeExecutor,
    oracle: Any,
    mesh_name: str,
    slots: int,
    *,
    server: str | Server | Client,
    credentials: Credentials | None = None,
    worker: str = "executor",
    max_chunk: int | None = None,
) -> ExecutorWorkers:
    """Workers for a mesh whose oracle runs on an executor: processes, Dask, MPI.

        with ProcessPoolExecutor(32) as pool:
            workers = stellate.executors.workers_on(pool, oracle, mesh.name, 32, server=server)
            states = workers.wait()

    Returns immediately. Each slot is a stream to the server, which hands every chunk of questions that
    comes to `executor.submit`; a slot for each of the executor's workers keeps all of them busy.
    The oracle and its answers are pickled. A process of the executor makes its oracle once and
    keeps it; one that is not `thread_safe` is called by one thread of a process at a time.

    What the oracle raises there is raised by wait(), and reported to the server. What the executor
    loses, because a machine or a process of it died, is submitted again, up to three times.

    Args:
      executor: a concurrent.futures.Executor, such as ProcessPoolExecutor, Dask's
        Client.get_executor() or mpi4py.futures.MPIPoolExecutor; it is left open. Or a function that
        makes one: it is called again when an executor breaks, as a ProcessPoolExecutor does when a
        process of it dies.
      mesh_name: "meshes/<id>", as Client.create gives it.
      server, credentials: as for stellate.serve.
      worker: what the server's log calls them, with the slot's number.
      max_chunk: the most points in one call of the oracle.
    """
    return ExecutorWorkers(
        executor, oracle, mesh_name, slots, server, credentials, worker, max_chunk
    )
