"""3MF, what slicers for 3D printers read: an object a region, in millimetres (core specification 1.3)."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from xml.sax.saxutils import quoteattr

import numpy as np

from .._complex import Complex
from .._version import __version__
from .parts import Part, parts

_TYPES = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
    '<Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    '<Default Extension="model" ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/>'
    "</Types>\n"
)
_RELATIONS = (
    '<?xml version="1.0" encoding="UTF-8"?>\n'
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    '<Relationship Target="/3D/3dmodel.model" Id="model" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>\n'
)
_AS_OF = (1980, 1, 1, 0, 0, 0)  # the same mesh, the same file


def contents(mesh: Complex, cells: np.ndarray) -> bytes:
    """The file of a surface of space, or of a solid, with these cells."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in (
            ("[Content_Types].xml", _TYPES),
            ("_rels/.rels", _RELATIONS),
            ("3D/3dmodel.model", "\n".join(_model(parts(mesh, cells, ".3mf"))) + "\n"),
        ):
            archive.writestr(
                zipfile.ZipInfo(name, _AS_OF), text, compress_type=zipfile.ZIP_DEFLATED
            )
    return packed.getvalue()


def _model(every: list[Part]) -> Iterator[str]:
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield (
        '<model unit="millimeter" xml:lang="en" '
        'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
    )
    yield f'<metadata name="Application">stellate {__version__}</metadata>'
    yield "<resources>"
    for number, part in enumerate(every, 1):
        # "model": what is closed, and can be printed; "surface": what is not.
        kind = "model" if part.closed else "surface"
        yield f'<object id="{number}" type="{kind}" name={quoteattr(part.name)}><mesh><vertices>'
        for x, y, z in part.points.tolist():
            yield f'<vertex x="{x:.17g}" y="{y:.17g}" z="{z:.17g}"/>'
        yield "</vertices><triangles>"
        for a, b, c in part.triangles.tolist():
            yield f'<triangle v1="{a}" v2="{b}" v3="{c}"/>'
        yield "</triangles></mesh></object>"
    yield "</resources><build>"
    yield from (f'<item objectid="{number}"/>' for number in range(1, len(every) + 1))
    yield "</build></model>"
