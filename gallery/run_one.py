"""Runs one program of the gallery here, and writes facts.json about its mesh: run_one.py NAME."""

import json
import pathlib
import runpy
import sys

name = sys.argv[1]
mesh = runpy.run_path(str(pathlib.Path(__file__).resolve().parent / f"{name}.py"))["mesh"]
certificate = mesh.report.certificate
facts = {
    "dimension": mesh.dimension,
    "ambient_dimension": mesh.ambient_dimension,
    "vertices": len(mesh.points),
    "simplices": len(mesh.simplices),
    "certified": certificate.certified,
    "verdict": certificate.verdict,
    "components": certificate.components,
    "euler_characteristic": certificate.euler_characteristic,
    "orientable": certificate.orientable,
    "epsilon": mesh.report.epsilon,
}
if mesh.walls is not None:
    corners = sum(len(face.simplices) for face in mesh.corners)
    facts["faces"] = [len(mesh.boundary), len(mesh.edges), corners]
told = {"facts": facts, "seconds": mesh.report.elapsed_seconds}
pathlib.Path("facts.json").write_text(json.dumps(told))
