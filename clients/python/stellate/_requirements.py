"""What the package stands on, named where it is missing, before anything imports it."""

from __future__ import annotations

import importlib

# By what is imported: Debian's package, and PyPI's.
_PACKAGES = {
    "numpy": ("python3-numpy", "numpy"),
    "google.protobuf": ("python3-protobuf", "protobuf"),
    "grpc": ("python3-grpcio", "grpcio"),
}


def insist() -> None:
    """Raises: ImportError, with what to install."""
    missing = []
    for module, packages in _PACKAGES.items():
        try:
            importlib.import_module(module)
        except ModuleNotFoundError:
            missing.append((module, *packages))
    if missing:
        modules, debian, pypi = zip(*missing)
        raise ImportError(
            f"stellate needs {' and '.join(modules)}, which this Python has not: "
            f"apt-get install {' '.join(debian)}, for Debian's /usr/bin/python3, or "
            f"pip install {' '.join(pypi)}",
            name=modules[0],
        )
