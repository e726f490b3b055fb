"""gRPC's calls, which must not outlive what opened them: see stellate._wire.calls."""

import pytest
import stellate
from stellate import manifolds
from stellate._wire.calls import end


def has_let_go(call):
    return not call.add_callback(lambda: None)


@pytest.fixture
def calls(monkeypatch):
    """All the streams that clients open."""
    opened = []
    channel = stellate.Credentials.channel

    def watched(credentials, *arguments):
        made = channel(credentials, *arguments)
        for kind in ("unary_stream", "stream_stream"):
            method = getattr(made, kind)

            def kept(*names, method=method, **options):
                start = method(*names, **options)

                def call(*given, **more):
                    opened.append(start(*given, **more))
                    return opened[-1]

                return call

            setattr(made, kind, kept)
        return made

    monkeypatch.setattr(stellate.Credentials, "channel", watched)
    return opened


def test_one_that_is_ended_holds_no_lock(server, calls):
    with stellate.Client(server) as client:
        name = client.create(manifolds.Torus(), 0.3).name
        watch = client.watch(name)
        next(iter(watch))
        assert not has_let_go(calls[-1])
        end(calls[-1])
        assert has_let_go(calls[-1])
        end(calls[-1])  # again: nothing to wait for


def test_none_outlives_a_mesh(server, calls):
    with stellate.Client(server) as client:
        stellate.mesh(manifolds.Torus(), 0.3, client)
        assert len(calls) >= 2 and all(map(has_let_go, calls))


def test_none_outlives_an_oracle_that_fails(server, calls):
    class Broken(manifolds.Torus):
        def closest_point(self, x):
            raise RuntimeError("no licence")

    with stellate.Client(server) as client:
        with pytest.raises(RuntimeError, match="no licence"):
            stellate.mesh(Broken(), 0.3, client)
        assert calls and all(map(has_let_go, calls))
