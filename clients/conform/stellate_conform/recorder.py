"""Recorded sessions: see proto/stellate/rpc/session.proto."""

from __future__ import annotations

import pathlib
import struct
import threading
from collections.abc import Iterator
from typing import Any, BinaryIO

from google.protobuf.message import DecodeError
from stellate._generated import session_pb2 as pb
from stellate._generated import status_details_pb2 as details_pb


class Recorder:
    """Writes what comes and goes to a file, or nowhere. Any thread."""

    def __init__(self, path: str | None = None) -> None:
        """Raises: OSError."""
        self._file: BinaryIO | None = None if path is None else open(path, "wb")
        self._lock = threading.Lock()
        self._calls = 0

    def begin(self, method: str) -> Call:
        with self._lock:
            self._calls += 1
            return Call(self, self._calls, method)

    def write(self, message: pb.SessionMessage) -> None:
        raw = message.SerializeToString()
        with self._lock:
            if self._file is not None:
                self._file.write(struct.pack("<I", len(raw)) + raw)

    def close(self) -> None:
        with self._lock:
            if self._file is not None:
                self._file.close()
                self._file = None


class Call:
    """One call on its way into the record."""

    def __init__(self, recorder: Recorder, number: int, method: str) -> None:
        self._recorder, self._number, self._method = recorder, number, method

    def came(self, message: Any) -> None:
        self._note(from_client=True, message=message.SerializeToString())

    def client_done(self) -> None:
        self._note(from_client=True, client_done=True)

    def sent(self, message: Any) -> None:
        self._note(message=message.SerializeToString())

    def ended(self, code: int = 0, words: str = "", details: bytes = b"") -> None:
        try:
            status = details_pb.Status.FromString(details)
        except DecodeError:  # the kit sends garbage too
            status = details_pb.Status()
        status.code, status.message = code, words
        self._note(status=status)

    def _note(self, **content: Any) -> None:
        self._recorder.write(pb.SessionMessage(call=self._number, method=self._method, **content))


def read_session(path: str | pathlib.Path) -> Iterator[pb.SessionMessage]:
    """What a file holds. Raises: OSError; ValueError where it is cut short."""
    raw, at = pathlib.Path(path).read_bytes(), 0
    while at < len(raw):
        end = at + 4 + int.from_bytes(raw[at : at + 4], "little")
        if end > len(raw):
            raise ValueError(f"{path} ends within a message")
        yield pb.SessionMessage.FromString(raw[at + 4 : end])
        at = end
