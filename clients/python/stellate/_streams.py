"""Streams that are opened again where they broke off."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, Callable, Generic, TypeVar

import grpc

from ._generated import stellate_pb2 as pb
from ._generated import stellate_pb2_grpc as rpc
from ._reconnect import Reconnector
from ._wire.calls import end
from .errors import from_rpc, protocol_error

Self = TypeVar("Self", bound="ResumableStream[Any]")
Message = TypeVar("Message")


class ResumableStream(ABC, Generic[Message]):
    """An iterator over the messages of a stream that survives a lost connection.

    `on_resume` is called when it was lost, before it is opened again.
    """

    def __init__(self, attempts: Reconnector) -> None:
        self._attempts = attempts
        self._stream: Any = None
        self._over = False
        self.on_resume: Callable[[], object] = lambda: None

    @abstractmethod
    def _open(self) -> Any:
        """The stream of a new attempt."""

    @abstractmethod
    def _take(self, message: Message) -> bool:
        """Notes where to go on after a message; whether it is the last."""

    def __iter__(self: Self) -> Self:
        return self

    def __next__(self) -> Message:
        while not self._over:
            try:
                if self._stream is None:
                    self._stream = self._open()
                    if self._attempts.stopped:  # by another thread, which saw no stream
                        self._stream.cancel()
                message: Message = next(self._stream)
            except StopIteration:
                raise protocol_error("it ended a stream too early") from None
            except grpc.RpcError as error:
                self._stream = None
                self._attempts.wait_or_raise(error, self._attempts.explain(from_rpc(error)))
                self.on_resume()
                continue
            self._attempts.heard()
            self._over = self._take(message) or self._over
            return message
        raise StopIteration

    def close(self) -> None:
        """Reads no more. Any thread may call it."""
        self._over = True
        self._attempts.stop()
        if self._stream is not None:
            end(self._stream)


class Watch(ResumableStream[pb.WatchMeshResponse]):
    """A mesh's events as they come. Closing it leaves the mesh alone.

    After a break it goes on from the last complete revision; chunks of an incomplete one are sent
    again, which `on_resume` announces.
    """

    def __init__(
        self,
        stub: rpc.StellateStub,
        attempts: Reconnector,
        name: str,
        from_revision: int,
        progress_only: bool,
    ) -> None:
        super().__init__(attempts)
        self._stub = stub
        self._request = pb.WatchMeshRequest(
            name=name, from_revision=from_revision, progress_only=progress_only
        )

    def _open(self) -> Any:
        return self._stub.WatchMesh(self._request)

    def _take(self, message: pb.WatchMeshResponse) -> bool:
        kind = message.WhichOneof("event")
        if kind == "delta" and message.delta.complete:
            self._request.from_revision = message.delta.delta.revision
        elif kind == "reset_mesh":
            self._request.from_revision = 0
        return kind == "final"


class Parts(ResumableStream[pb.DownloadMeshResponse]):
    """The parts of a mesh as it was at one revision. After a break no part comes twice."""

    def __init__(
        self, stub: rpc.StellateStub, attempts: Reconnector, name: str, revision: int
    ) -> None:
        super().__init__(attempts)
        self._stub = stub
        self._request = pb.DownloadMeshRequest(name=name, revision=revision)

    def _open(self) -> Any:
        return self._stub.DownloadMesh(self._request)

    def _take(self, message: pb.DownloadMeshResponse) -> bool:
        self._request.revision = message.revision
        self._request.position = message.next_position
        return message.complete
