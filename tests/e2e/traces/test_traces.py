"""stellated --traces-to: what a collector gets of meshes, and what meshes get of a collector: nothing."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import threading
import time
import urllib.request

import numpy as np
import pytest
import stellate
from conftest import free_port, stranger
from opentelemetry import trace
from opentelemetry.proto.trace.v1 import trace_pb2
from opentelemetry.sdk.trace import TracerProvider
from opentelemetry.sdk.trace.sampling import ALWAYS_OFF
from stellate import manifolds

TRACER = TracerProvider().get_tracer("a user's program")
VARIABLES = ("OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_SERVICE_NAME", "OTEL_EXPORTER_OTLP_HEADERS")


def attributes(span) -> dict:
    values = {}
    for pair in span.attributes:
        values[pair.key] = getattr(pair.value, pair.value.WhichOneof("value"))
    return values


def ids(span) -> tuple[bytes, bytes]:
    context = span.get_span_context()
    return context.trace_id.to_bytes(16, "big"), context.span_id.to_bytes(8, "big")


class Program:
    """A stellated as an operator starts it."""

    def __init__(self, *arguments: str, **environment: str) -> None:
        command = [stellate.server.find_stellated(), "--listen", "127.0.0.1:0", *arguments]
        self.metrics = free_port()
        command += ["--metrics-listen", f"127.0.0.1:{self.metrics}", "--log-level", "debug"]
        self.process = subprocess.Popen(
            [*command, "--exit-with-parent"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            text=True, env={**os.environ, **environment},
        )  # fmt: skip
        self.address = self.process.stdout.readline().split()[-1]

    def stop(self, how: int = signal.SIGTERM) -> int:
        self.process.send_signal(how)
        return self.process.wait()

    def __enter__(self) -> Program:
        return self

    def __exit__(self, *raised: object) -> None:
        self.process.kill()
        self.process.wait()


@pytest.fixture
def told(collector):
    with Program("--traces-to", collector.url) as program:
        yield program


def test_the_trace_of_a_program_goes_on_through_its_mesh(told, collector):
    with TRACER.start_as_current_span("study") as study:
        mesh = stellate.mesh(manifolds.Sphere(), 0.3, server=told.address)
    assert told.stop() == 0
    of_trace, of_study = ids(study)
    spans = [span for _, span in collector.spans]
    assert {span.trace_id for span in spans} == {of_trace}
    assert len({span.span_id for span in spans}) == len(spans)
    (whole,) = collector.named("mesh")
    assert whole.parent_span_id == of_study
    assert whole.kind == trace_pb2.Span.SPAN_KIND_SERVER
    assert attributes(whole)["stellate.vertices"] == len(mesh.points)
    assert attributes(whole)["stellate.certified"] is True
    assert whole.status.code == trace_pb2.Status.STATUS_CODE_UNSET
    by_id = {span.span_id: span for span in spans}
    above = {"round": "mesh", "plan": "round", "ask": "round", "absorb": "round", "chunk": "ask"}
    for span in spans:
        assert 0 < span.start_time_unix_nano <= span.end_time_unix_nano
        if span.name in above:
            parent = by_id[span.parent_span_id]
            assert parent.name == above[span.name]
            assert parent.start_time_unix_nano <= span.start_time_unix_nano
            assert span.end_time_unix_nano <= parent.end_time_unix_nano
    assert len(collector.named("round")) == attributes(whole)["stellate.rounds"]
    for worker in collector.named("worker"):
        assert worker.parent_span_id == of_study, "the worker serves for the study, too"
        assert worker.links[0].span_id == whole.span_id
    assert {pair.key: pair.value.string_value for pair in collector.spans[0][0].attributes}[
        "service.name"
    ] == "stellated"


def test_a_trace_goes_on_in_c_plus_plus(told, collector):
    """stellate::Connection::trace, which the command line fills in."""
    parent = f"00-{'4b' * 16}-{'a2' * 8}-01"
    program = [stellate.viewer.find_stellate(), "mesh", "sphere:2", "-e", "0.3", "-q"]
    subprocess.run(
        [*program, "--server", told.address],
        env={**os.environ, "TRACEPARENT": parent, "TRACESTATE": "theirs=1"},
        check=True,
    )
    assert told.stop() == 0
    (whole,) = collector.named("mesh")
    assert whole.trace_id.hex() == "4b" * 16 and whole.parent_span_id.hex() == "a2" * 8
    assert whole.trace_state == "theirs=1"
    assert [w.parent_span_id.hex() for w in collector.named("worker")] == ["a2" * 8]


def test_without_a_trace_a_mesh_begins_one_that_has_its_name(told, collector):
    with stellate.Client(told.address) as client:
        name = client.create(manifolds.Sphere(), 0.3).name
        assert client.serve(manifolds.Sphere(), name) == "SUCCEEDED"
    (whole,) = collector.wait_for("mesh")
    assert whole.trace_id.hex() == name.removeprefix("meshes/")
    assert whole.parent_span_id == b""


def test_a_trace_that_is_not_sampled_has_no_spans(told, collector):
    silent = TracerProvider(sampler=ALWAYS_OFF).get_tracer("silent")
    with silent.start_as_current_span("study"):
        stellate.mesh(manifolds.Sphere(), 0.3, server=told.address)
    assert told.stop() == 0
    assert collector.spans == []


def test_a_mesh_that_fails_is_an_error_with_its_reason(told, collector):
    class Broken(manifolds.Sphere):
        def closest_point(self, points):
            return np.full_like(points, np.nan)

    with pytest.raises(stellate.StellateError):
        stellate.mesh(Broken(), 0.3, server=told.address)
    (whole,) = collector.wait_for("mesh")
    assert whole.status.code == trace_pb2.Status.STATUS_CODE_ERROR
    assert attributes(whole)["stellate.state"] == "FAILED"
    assert attributes(whole)["stellate.reason"] in whole.status.message or whole.status.message
    assert collector.named("round")[-1].status.message == whole.status.message


def test_a_declaration_that_is_repeated_in_another_span_is_one_mesh(told, collector):
    with stellate.Client(told.address) as client:
        sent = []
        stub = client._stub
        create = stub.CreateMesh
        stub.CreateMesh = lambda request, **more: (sent.append(request), create(request, **more))[1]
        name = client.create(manifolds.Sphere(), 0.3).name
        with TRACER.start_as_current_span("again"):
            parent = trace_header()
            assert create(sent[0], metadata=parent).name == name
        client.cancel(name)
    (whole,) = collector.wait_for("mesh")
    assert whole.parent_span_id == b"", "the first call made it"


def trace_header() -> tuple[tuple[str, str], ...]:
    context = trace.get_current_span().get_span_context()
    return (("traceparent", f"00-{context.trace_id:032x}-{context.span_id:016x}-01"),)


def test_nonsense_in_the_headers_is_no_trace(told, collector):
    with stellate.Client(told.address) as client:
        create = client._stub.CreateMesh
        for parent in ("", "x" * 5000, f"00-{'0' * 32}-{'0' * 16}-01"):
            client._stub.CreateMesh = lambda request, parent=parent, **more: create(
                request, metadata=(("traceparent", parent), ("tracestate", "a=1"))
            )
            client.cancel(client.create(manifolds.Sphere(), 0.3).name)
    for span in collector.wait_for("mesh", 3):
        assert span.parent_span_id == b"" and span.trace_state == ""


class Waiting(manifolds.Torus):
    """A torus that says when its n-th batch has come, and waits."""

    def __init__(self, n: int) -> None:
        super().__init__()
        self.left, self.there, self.go_on = n, threading.Event(), threading.Event()

    def closest_point(self, points):
        self.left -= 1
        if self.left == 0:
            self.there.set()
            self.go_on.wait()
        return super().closest_point(points)


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_a_mesh_that_another_server_takes_up_stays_in_its_trace(tmp_path, collector, how):
    arguments = ("--traces-to", collector.url, "--data-dir", str(tmp_path), "--drain-seconds", "0")
    oracle = Waiting(5)
    with Program(*arguments) as first, stellate.Client(first.address) as client:
        with TRACER.start_as_current_span("study") as study:
            name = client.create(oracle, 0.15).name
            worker = client.worker(oracle, name)
        serving = threading.Thread(target=serve_to_the_end, args=(worker,), daemon=True)
        serving.start()
        oracle.there.wait()
        first.stop(how)
        worker.stop()
        oracle.go_on.set()
        serving.join()
    with Program(*arguments) as second, stellate.Client(second.address) as client:
        assert client.serve(manifolds.Torus(), name) == "SUCCEEDED"
        assert second.stop() == 0
    of_trace, of_study = ids(study)
    wholes = collector.named("mesh")
    assert all(whole.trace_id == of_trace for whole in wholes)
    assert all(whole.parent_span_id == of_study for whole in wholes)
    assert [attributes(whole)["stellate.state"] for whole in wholes] == (
        ["SUSPENDED", "SUCCEEDED"] if how == signal.SIGTERM else ["SUCCEEDED"]
    )
    assert attributes(wholes[-1])["stellate.resumed"] is True
    (replay,) = collector.named("replay")
    assert replay.parent_span_id == wholes[-1].span_id
    rounds = [
        attributes(span)["stellate.round"]
        for span in collector.named("round")
        if span.parent_span_id == wholes[-1].span_id
    ]
    assert rounds == list(range(attributes(replay)["stellate.rounds"] + 1, rounds[-1] + 1))


def serve_to_the_end(worker) -> None:
    try:
        worker.run()
    except stellate.StellateError:
        pass


def counted(program: Program, name: str) -> float:
    """A counter of the server's metrics."""
    with urllib.request.urlopen(f"http://127.0.0.1:{program.metrics}/metrics") as page:
        found = re.search(rf"^{name} (\S+)$", page.read().decode(), re.M)
    assert found, name
    return float(found[1])


@pytest.mark.parametrize("kind", ["silent", "away", "mute", "garbage"])
def test_a_collector_that_takes_nothing_costs_no_mesh_a_bit(collector, kind):
    expected = stellate.mesh(manifolds.Torus(), 0.15)
    collector.answers.clear()
    with contextlib.ExitStack() as around:
        url = collector.url if kind == "silent" else around.enter_context(stranger(kind))
        program = around.enter_context(Program("--traces-to", url))
        for _ in range(5):
            mesh = stellate.mesh(manifolds.Torus(), 0.15, server=program.address)
            assert mesh.points.tobytes() == expected.points.tobytes()
            assert mesh.simplices.tobytes() == expected.simplices.tobytes()
        while counted(program, "stellate_spans_dropped_total") == 0:
            stellate.mesh(manifolds.Torus(), 0.15, server=program.address)
        assert counted(program, "stellate_spans_sent_total") == 0
        assert program.stop() == 0


def test_the_usual_variables_are_enough(collector):
    values = (collector.url, "mesher", "authorization=Bearer%20x")
    with Program(**dict(zip(VARIABLES, values))) as program:
        stellate.mesh(manifolds.Sphere(), 0.3, server=program.address)
        collector.wait_for("mesh")
        while counted(program, "stellate_spans_sent_total") < len(collector.spans):
            time.sleep(0.01)
        assert program.stop() == 0
    assert collector.headers[0]["authorization"] == "Bearer x"
    says = {pair.key: pair.value.string_value for pair in collector.spans[0][0].attributes}
    assert says["service.name"] == "mesher"
    assert says["service.version"]


def test_a_url_that_is_none_stops_the_server_and_a_variable_does_not(collector):
    program = stellate.server.find_stellated()
    command = [program, "--listen", "127.0.0.1:0", "--traces-to", "localhost:4317"]
    refused = subprocess.run(command, capture_output=True, text=True)
    assert refused.returncode == 2
    assert '--traces-to is "localhost:4317" but must be http://HOST:PORT' in refused.stderr
    with Program(OTEL_EXPORTER_OTLP_ENDPOINT="localhost:4317") as program:
        assert stellate.mesh(manifolds.Sphere(), 0.3, server=program.address).certified


def test_a_reconstruction_and_an_examination_tell_of_themselves(told, collector):
    points = stellate.mesh(manifolds.Sphere(), 0.2).points
    with TRACER.start_as_current_span("study") as study:
        stellate.reconstruct(points, 2, server=told.address)
        stellate.check(manifolds.Sphere(), server=told.address)
    of_trace, of_study = ids(study)
    for name in ("reconstruction", "examination"):
        (whole,) = collector.wait_for(name)
        assert (whole.trace_id, whole.parent_span_id) == (of_trace, of_study)
        rounds = [s for s in collector.named("round") if s.parent_span_id == whole.span_id]
        assert rounds
