"""numpy's archives: all that a mesh is, exact, for programs that have numpy."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from .._complex import Complex

# Of a mesh, beside "epsilon", "certified" and "verdict"; those that it has not got are not there.
ARRAYS = ("points", "simplices", "walls", "labels", "places", "smoothed")


def contents(mesh: Complex) -> bytes:
    """The file of any mesh."""
    arrays: dict[str, Any] = {}
    for name in ARRAYS:
        values = getattr(mesh, name)
        if values is not None:
            arrays[name] = np.asarray(values)
    if arrays.get("places") is not None:
        arrays["places"] = arrays["places"].astype(str)  # no pickles
    if mesh.region_names:
        arrays["region_names"] = np.array(mesh.region_names, dtype=str)
    if mesh.report is not None:
        arrays["certified"] = np.array(mesh.report.certified)
        arrays["verdict"] = np.array(mesh.report.certificate.verdict, dtype=str)
        arrays["epsilon"] = np.array(mesh.report.epsilon)
    packed = io.BytesIO()
    np.savez_compressed(packed, **arrays)
    return packed.getvalue()
