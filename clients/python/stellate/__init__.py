"""Meshes of smooth manifolds of any dimension, known through oracles alone.

    mesh = stellate.mesh(oracle, epsilon=0.1)
    print(mesh.report)
    mesh.save("manifold.vtu")

`stellate.Oracle` says what an oracle is, and `stellate.check` whether yours is one.
`stellate.ImplicitManifold` makes one from equations, `stellate.ImplicitSolid` a solid,
`stellate.oracles` makes them of charts, distances, points and triangles, and cuts them by walls,
`stellate.CommandOracle` of a program, and `stellate.manifolds` has a few ready. Where there are only
points, `stellate.reconstruct` makes the mesh of them.

What fewer need is in modules of its own: `stellate.executors`, an oracle on many processes and
machines; `stellate.pulling`, on a thread of yours alone; `stellate.learning`, a mesh of points by
scikit-learn's conventions; `stellate.client`, a server call by call; `stellate.server`, where it is
looked for; `stellate.viewer`, meshes that grow in a browser; `stellate.options` and
`stellate.report`, all that a mesh is asked for and says.
"""

from . import _requirements, _stubs

_requirements.insist()
_stubs.ensure()  # before anything imports them

from . import client as client  # noqa: E402
from . import errors as errors  # noqa: E402
from . import executors as executors  # noqa: E402
from . import learning as learning  # noqa: E402
from . import manifolds, oracles  # noqa: E402
from . import options as options  # noqa: E402
from . import progress as progress  # noqa: E402
from . import pulling as pulling  # noqa: E402
from . import report as report  # noqa: E402
from . import server as server  # noqa: E402
from . import solids as solids  # noqa: E402
from . import viewer as viewer  # noqa: E402
from ._api import check, download, mesh, serve, watch  # noqa: E402
from ._command_oracle import CommandOracle  # noqa: E402
from ._credentials import Credentials  # noqa: E402
from ._faces import Face  # noqa: E402
from ._files.formats import check_save  # noqa: E402
from ._findings import CheckReport, Finding  # noqa: E402
from ._mesh import FinishedMesh, Mesh, load_txt  # noqa: E402
from ._reconstruct import reconstruct  # noqa: E402
from ._series import save_series  # noqa: E402
from ._version import __version__ as __version__  # noqa: E402
from .client import Client  # noqa: E402
from .errors import *  # noqa: E402, F403
from .options import MeshOptions  # noqa: E402
from .oracle import Oracle  # noqa: E402
from .oracles import ImplicitManifold, ImplicitSolid  # noqa: E402
from .progress import progress_bar  # noqa: E402
from .report import Progress, Report  # noqa: E402
from .server import Server  # noqa: E402

__all__ = [
    "CheckReport",
    "Client",
    "CommandOracle",
    "Credentials",
    "Face",
    "Finding",
    "FinishedMesh",
    "ImplicitManifold",
    "ImplicitSolid",
    "Mesh",
    "MeshOptions",
    "Oracle",
    "Progress",
    "Report",
    "Server",
    "check",
    "check_save",
    "download",
    "load_txt",
    "manifolds",
    "oracles",
    "mesh",
    "progress_bar",
    "reconstruct",
    "save_series",
    "serve",
    "watch",
]
__all__ += errors.__all__
