"""Meshes of smooth manifolds of any dimension, known through oracles alone.

    mesh = stellate.mesh(oracle, epsilon=0.1)
    print(mesh.report)
    mesh.save("manifold.vtu")

`stellate.Oracle` says what an oracle is, and `stellate.check` whether yours is one.
`stellate.ImplicitManifold` makes one from equations, `stellate.ImplicitSolid` a solid,
`stellate.oracles` makes them of charts, distances, points and triangles, and cuts them by walls,
`stellate.CommandOracle` of a program, and `stellate.manifolds` has a few ready.
"""

from . import _requirements, _stubs

_requirements.insist()
_stubs.ensure()  # before anything imports them

from . import manifolds, oracles  # noqa: E402
from ._api import download, mesh, serve, watch  # noqa: E402
from ._chunks import Chunk, Puller  # noqa: E402
from ._command_oracle import CommandOracle  # noqa: E402
from ._credentials import Credentials  # noqa: E402
from ._doctor.check import check  # noqa: E402
from ._doctor.findings import CheckReport, Finding  # noqa: E402
from ._executors import ExecutorWorkers, workers_on  # noqa: E402
from ._files.formats import check_save  # noqa: E402
from ._mesh import FinishedMesh, Mesh, load_txt  # noqa: E402
from ._pull import pull, pull_check  # noqa: E402
from ._series import save_series  # noqa: E402
from ._server import Server, find_stellated  # noqa: E402
from ._version import __version__ as __version__  # noqa: E402
from ._view import LiveView  # noqa: E402
from .client import Client, MeshInfo, ServerInfo  # noqa: E402
from .errors import (  # noqa: E402
    Cancelled,
    ExecutorError,
    FailedPrecondition,
    Interrupted,
    InvalidArgument,
    LimitExceeded,
    MeshNotFound,
    NotCertified,
    NotConverged,
    OracleError,
    SaveError,
    ServerNotFound,
    StellateError,
    Unauthenticated,
    Unavailable,
    UncertifiedWarning,
    ViewerNotFound,
)
from .implicit import ImplicitManifold  # noqa: E402
from .options import MeshOptions  # noqa: E402
from .oracle import Oracle  # noqa: E402
from .oracles import ImplicitSolid  # noqa: E402
from .progress import ProgressBar, progress_bar  # noqa: E402
from .report import (  # noqa: E402
    Certificate,
    Counts,
    FaceCertificate,
    Failure,
    Progress,
    Report,
    Violations,
    WallAngle,
)

__all__ = [
    "Cancelled",
    "Certificate",
    "CheckReport",
    "Chunk",
    "Client",
    "CommandOracle",
    "Counts",
    "Credentials",
    "ExecutorError",
    "ExecutorWorkers",
    "FaceCertificate",
    "FailedPrecondition",
    "Failure",
    "Finding",
    "FinishedMesh",
    "ImplicitManifold",
    "ImplicitSolid",
    "Interrupted",
    "InvalidArgument",
    "LimitExceeded",
    "LiveView",
    "Mesh",
    "MeshInfo",
    "MeshNotFound",
    "MeshOptions",
    "NotCertified",
    "NotConverged",
    "Oracle",
    "OracleError",
    "Progress",
    "ProgressBar",
    "Puller",
    "Report",
    "SaveError",
    "Server",
    "ServerInfo",
    "ServerNotFound",
    "StellateError",
    "Unauthenticated",
    "Unavailable",
    "UncertifiedWarning",
    "ViewerNotFound",
    "Violations",
    "WallAngle",
    "check",
    "check_save",
    "download",
    "find_stellated",
    "load_txt",
    "manifolds",
    "oracles",
    "mesh",
    "progress_bar",
    "pull",
    "pull_check",
    "save_series",
    "serve",
    "watch",
    "workers_on",
]
