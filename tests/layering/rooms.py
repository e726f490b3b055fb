"""The rooms of the house, and who may take from whom.

Each line is a room, a folder or one file, and the rooms of which its files may include headers or
import modules; from itself it always may. The longest name counts: `core/mesher.cc` is not of
`core`. A room may only take from rooms that do not take from it, over whatever way: the table must
not go in a circle. `core` alone, without a folder, is the face of the core, the headers that
the server may take, beside `core/base`.

Who adds a folder, or needs a header of a room that is not listed, adds it here, and asks first
whether the wall stands where it should.
"""

from __future__ import annotations

from checker import Table

_GROUND = ("core", "core/base", "core/index", "core/geometry")

CORE = {
    "core/base": (),
    "core": ("core/base",),
    "core/index": ("core", "core/base"),
    "core/geometry": ("core", "core/base", "core/index"),
    # What parts of one mesh tell each other.
    "core/parts": ("core", "core/base"),
    "core/complex": (*_GROUND, "core/parts"),
    # What is judged; the complex alone; its shape; what was answered; what follows from all that.
    "core/certificate": ("core", "core/base"),
    "core/certificate/complex": ("core", "core/base"),
    "core/certificate/measure": (*_GROUND, "core/certificate", "core/certificate/complex"),
    "core/certificate/evidence": (
        *_GROUND,
        "core/certificate",
        "core/certificate/complex",
        "core/certificate/measure",
    ),
    "core/certificate/claims": (
        *_GROUND,
        "core/certificate",
        "core/certificate/complex",
        "core/certificate/measure",
        "core/certificate/evidence",
    ),
    "core/certificate/certifier.cc": (
        "core",
        "core/base",
        "core/certificate",
        "core/certificate/claims",
        "core/certificate/evidence",
    ),
    "core/certificate/boundary_certifier.cc": (
        "core",
        "core/base",
        "core/certificate",
        "core/certificate/claims",
    ),
    "core/boundary": (*_GROUND, "core/complex"),
    "core/rules": (*_GROUND, "core/complex", "core/boundary"),
    "core/refinement": (*_GROUND, "core/parts", "core/complex", "core/boundary", "core/rules"),
    "core/sampling": (*_GROUND, "core/refinement", "core/parts"),
    "core/speculation": (*_GROUND, "core/complex", "core/refinement", "core/sampling"),
    "core/run": (
        *_GROUND,
        "core/complex",
        "core/certificate",
        "core/certificate/evidence",
        "core/boundary",
        "core/refinement",
        "core/sampling",
        "core/speculation",
    ),
    "core/examination": ("core", "core/base"),  # whether an oracle keeps its contract
    "core/reconstruction": (
        *_GROUND,
        "core/complex",
        "core/certificate",
        "core/certificate/complex",
        "core/certificate/claims",
        "core/certificate/measure",
    ),
    # The doors from the face.
    "core/reconstruction.cc": ("core", "core/base", "core/reconstruction"),
    "core/mesher.cc": ("core", "core/base", "core/run"),
    "core/examiner.cc": ("core", "core/base", "core/examination"),
}

# What the server may take of the core.
FACE = ("core", "core/base")

SERVER = {
    "server/base": (*FACE, "text"),
    "server/memory": (*FACE, "server/base"),
    "server/history": (*FACE, "server/base"),
    "server/spans": (),
    "server/oracles": (*FACE, "server/base", "server/spans"),
    "server/points": (*FACE, "server/base", "server/history"),
    "server/turns": (*FACE, "server/base"),
    "server/session": (
        *FACE,
        "server/base",
        "server/turns",
        "server/points",
        "server/memory",
        "server/history",
        "server/oracles",
        "server/spans",
    ),
    # What a mesh's record looks like; the files it is in; who writes and reads them; salvage.
    "server/records": (*FACE, "server/base", "server/history", "server/oracles", "server/session"),
    "server/storage": (*FACE, "server/base", "server/records"),
    "server/journal": (
        *FACE,
        "server/base",
        "server/history",
        "server/oracles",
        "server/session",
        "server/records",
        "server/storage",
    ),
    "server/postgres": (*FACE, "server/base", "server/records", "server/storage"),
    "server/salvage": (*FACE, "server/base", "server/records", "server/storage"),
    "server/config": (*FACE, "server/base", "server/memory"),
    "server/grpc_parts": ("server/base",),
    "server/net": (*FACE, "server/base", "server/config", "server/grpc_parts"),
    "server/metrics": (
        *FACE,
        "server/base",
        "server/memory",
        "server/history",
        "server/oracles",
        "server/session",
    ),
    "server/convert": (
        *FACE,
        "proto",
        "server/base",
        "server/config",
        "server/history",
        "server/oracles",
        "server/points",
        "server/session",
        "text",
    ),
    "server/auth": (*FACE, "server/base", "server/config", "server/convert", "server/spans"),
    # Spans on their way to a collector.
    "server/otlp": (*FACE, "server/base", "server/config", "server/spans", "text"),
    "server/rpc": (
        *FACE,
        "proto",
        "server/base",
        "server/memory",
        "server/config",
        "server/history",
        "server/oracles",
        "server/points",
        "server/records",
        "server/session",
        "server/spans",
        "server/storage",
        "server/journal",
        "server/metrics",
        "server/convert",
        "server/auth",
        "text",
    ),
    "server": (
        *FACE,
        "proto",
        "server/base",
        "server/config",
        "server/oracles",
        "server/session",
        "server/journal",
        "server/postgres",
        "server/salvage",
        "server/grpc_parts",
        "server/net",
        "server/metrics",
        "server/otlp",
        "server/convert",
        "server/auth",
        "server/rpc",
    ),
}

# The Python package: its rooms, and the modules at its top that these may take.
PYTHON = {
    "_html.py": (),
    "_shared.py": (),
    "_version.py": (),
    "_wire/enums.py": ("proto",),
    "_certificate.py": ("_wire/enums.py", "proto"),
    "report.py": ("_certificate.py", "_html.py", "_version.py", "_wire/enums.py", "proto"),
    "_faces.py": (),
    "_complex.py": ("_faces.py", "report.py"),
    "errors.py": ("_complex.py", "_shared.py", "proto"),
    "_rows.py": (),
    "_lowest.py": ("_rows.py", "_shared.py"),
    "oracle.py": ("_rows.py", "errors.py"),
    "options.py": (),
    "_wire": ("errors.py", "options.py", "oracle.py", "_wire/enums.py", "proto"),
    "_files": ("_complex.py", "_faces.py", "_version.py", "errors.py", "report.py"),
    "_findings.py": ("_html.py", "proto"),
    "_rank.py": ("_findings.py", "_lowest.py", "_rows.py", "_shared.py", "oracle.py"),
    "_pipe": ("errors.py",),
}


def in_package(name: str) -> str:
    return name if name == "proto" else f"clients/python/stellate/{name}"


CLIENTS = {
    "clients/cpp/include": (),
    "clients/cpp/oracles": ("clients/cpp/include", "clients/cpp/pipe"),
    "clients/cpp/pipe": ("clients/cpp/include",),
    "clients/cpp/mesh": ("clients/cpp/include",),
    "clients/cpp/wire": ("clients/cpp/include", "proto"),
    "clients/cpp/net": ("clients/cpp/include", "clients/cpp/wire", "proto"),
    "clients/cpp/run": (
        "clients/cpp/include",
        "clients/cpp/mesh",
        "clients/cpp/net",
        "clients/cpp/oracles",  # how axes of different units are checked, and said
        "clients/cpp/wire",
        "proto",
    ),
    "clients/view/gateway": (
        "clients/cpp/include",
        "clients/cpp/mesh",
        "clients/cpp/net",
        "clients/cpp/wire",
        "proto",
    ),
    "clients/cli": ("clients/cpp/include", "clients/view/gateway", "text"),
    **{
        in_package(room): tuple(in_package(taken) for taken in takes)
        for room, takes in PYTHON.items()
    },
    "clients/python/stellate": ("proto", *(in_package(room) for room in PYTHON)),
    "clients/python/examples": ("clients/python/stellate",),
    # Which nobody takes.
    "clients/conform": (
        "clients/python/stellate",
        in_package("_shared.py"),
        in_package("_wire"),
        "proto",
    ),
}

# The program for MPI jobs: a client and the mesher in one process, whose messages are the wire's.
MPI = {
    "mpi": (
        *FACE,
        "core/parts",
        "proto",
        "clients/cli",
        "clients/cpp/include",
        "clients/cpp/mesh",
        "clients/cpp/run",
        "clients/cpp/wire",
        "server/base",
        "server/config",
        "server/convert",
        "server/history",
        "server/oracles",
        "server/session",
    )
}

# Tests may take what they test, and not more of the house than that.
EVERY_CORE = tuple(CORE)
EVERY_CPP = tuple(room for room in CLIENTS if room.startswith("clients/cpp/"))
EVERY_PYTHON = tuple(room for room in CLIENTS if room.startswith("clients/python/"))
EVERY_SERVER = tuple(SERVER)
TESTS = {
    "tests/support": (*FACE, "clients/cpp/include"),
    "tests/core": (*EVERY_CORE, "tests/support", "tests/reconstruction", "clients/cpp/include"),
    "tests/reconstruction": (*FACE, "core/index", "tests/support"),
    "tests/server": (*FACE, "proto", *EVERY_SERVER, "tests/support"),
    "tests/clients": ("proto", *EVERY_CPP, *EVERY_PYTHON, "clients/cli", "tests/support"),
    "tests/e2e": ("proto", *EVERY_CPP, *EVERY_PYTHON, "tests/support"),
}

TABLE = Table(
    rooms={"text": (), "proto": (), **CORE, **SERVER, **CLIENTS, **MPI, **TESTS},
    foreign={
        # The core is geometry: no clock, no file, no socket, no thread but oneTBB's, no wire.
        "Eigen/": ("core", "server", "clients/cpp", "mpi", "tests"),
        "tbb/": ("core", "tests/core"),
        "tl/": ("core", "server", "clients/cpp", "tests"),
        "chrono": ("server", "clients", "mpi", "tests"),
        "filesystem": ("server", "clients", "tests"),
        "fstream": ("server", "clients", "tests"),
        "iostream": ("server", "clients", "mpi", "tests"),
        "sys/": ("server", "clients", "tests"),
        "unistd.h": ("server", "clients", "tests"),
        # The wire: not where meshes are run, so that this builds and tests without gRPC.
        "google/": (
            "server/convert",
            "server/rpc",
            "server/net",
            "server/base",
            "clients/cpp/run",
            "clients/conform",
            "clients/python/stellate",
            "clients/view/gateway",
            "tests",
        ),
        "mpi.h": ("mpi",),
        "libpq-fe.h": ("server/postgres",),
        "sqlite3.h": ("server/storage", "tests/server"),
        "nanoflann.hpp": ("clients/cpp/oracles",),
        "boost/": ("clients/view/gateway",),  # the viewer's sockets, and nothing else
    },
    generated={"stellate/v1/": "proto", "stellate/rpc/": "proto"},
    packages={
        "stellate": "clients/python/stellate",
        "stellate_conform": "clients/conform/stellate_conform",
    },
    watched=(
        "core",
        "text",
        "server",
        "clients/cpp",
        "clients/view",
        "clients/cli",
        "clients/conform",
        "clients/python/stellate",
        "mpi",
    ),
    # Angles, of which only words and figures of the report are made, or a proof with a margin: no
    # question hangs on them.
    exact={
        "core": (
            "core/batch.cc",
            "core/certificate/claims/proof.cc",
            "core/certificate/claims/reach_claims.cc",
            "core/certificate/measure/together.cc",
            "core/certificate/measure/shape.cc",
            "core/examination/probe.cc",
            "core/geometry/reach.cc",
            "core/reconstruction/judgement.cc",
            "core/geometry/simplex.cc",
            "core/boundary/sharp_edges.cc",
            "core/boundary/wall_bends.cc",
            "core/run/ending.cc",
        )
    },
    acyclic=("core", "text", "server", "clients", "mpi", "tests"),
)
