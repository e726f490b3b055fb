"""How a client shows a server who it is, and makes sure of the server."""

from __future__ import annotations

import dataclasses
import os
import pathlib
import re
from typing import Any, Callable

import grpc

from .errors import InvalidArgument


@dataclasses.dataclass(frozen=True)
class Credentials:
    """TLS, and a token, for a server that wants them.

        who = stellate.Credentials(token=open("token").read().strip(), ca="ca.pem")
        mesh = stellate.mesh(oracle, epsilon=0.1, server="mesh.example.org:7717", credentials=who)

    stellate.Client, serve, watch and download take them likewise. Nothing is read or sent before that:
    files that are missing, a certificate without its key, and a token that would go over the network
    in plain text are found when the server is called (FileNotFoundError, stellate.InvalidArgument). The
    token is not shown by repr().

    Args:
      token: sent with every call. Over plain text only within this machine.
      ca: PEM file with the authority that signed the server's certificate.
      certificate, key: PEM files with the client's own, for a server that asks for one.
      tls: TLS with the system's authorities; implied by `ca` and `certificate`.
    """

    token: str | None = dataclasses.field(default=None, repr=False)
    ca: str | os.PathLike[str] | None = None
    certificate: str | os.PathLike[str] | None = None
    key: str | os.PathLike[str] | None = None
    tls: bool = False

    def channel(self, address: str, options: list[tuple[str, Any]]) -> grpc.Channel:
        """A channel to `address`. Raises InvalidArgument, OSError."""
        if (self.certificate is None) != (self.key is None):
            raise InvalidArgument("a client certificate and its key go together: give both")
        if self.tls or self.ca is not None or self.certificate is not None:
            security = grpc.ssl_channel_credentials(
                _read(self.ca), _read(self.key), _read(self.certificate)
            )
            channel = grpc.secure_channel(address, security, options)
        else:
            if self.token is not None and not stays_on_this_machine(address):
                raise InvalidArgument(
                    f"the token would go to {address} in plain text, for others to read and use: "
                    "turn TLS on"
                )
            channel = grpc.insecure_channel(address, options)
        return (
            channel if self.token is None else grpc.intercept_channel(channel, _Token(self.token))
        )


def _read(path: str | os.PathLike[str] | None) -> bytes | None:
    return None if path is None else pathlib.Path(path).read_bytes()


def stays_on_this_machine(address: str) -> bool:
    """Whether a server's address is a unix socket or the loopback."""
    if address.startswith("unix:"):
        return True
    host = address.rpartition(":")[0]
    return host in ("localhost", "[::1]") or re.fullmatch(r"127(\.\d+){3}", host) is not None


class _Details(grpc.ClientCallDetails):
    def __init__(self, details: grpc.ClientCallDetails, header: tuple[str, str]) -> None:
        self.method, self.timeout = details.method, details.timeout
        self.credentials, self.wait_for_ready = details.credentials, details.wait_for_ready
        self.compression = details.compression
        self.metadata = [*(details.metadata or ()), header]


class _Token(
    grpc.UnaryUnaryClientInterceptor,
    grpc.UnaryStreamClientInterceptor,
    grpc.StreamUnaryClientInterceptor,
    grpc.StreamStreamClientInterceptor,
):
    """Sends the token along. gRPC's own call credentials are refused on plain text."""

    def __init__(self, token: str) -> None:
        self._header = ("authorization", f"Bearer {token}")

    def _send(
        self, go_on: Callable[..., Any], details: grpc.ClientCallDetails, request: Any
    ) -> Any:
        return go_on(_Details(details, self._header), request)

    intercept_unary_unary = _send
    intercept_unary_stream = _send
    intercept_stream_unary = _send
    intercept_stream_stream = _send
