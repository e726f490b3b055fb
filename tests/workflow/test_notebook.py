"""The notebook runs from its first cell to its last, and shows what it says."""

import base64
import io
import os
import re

import matplotlib.image
import nbclient
import nbformat


def html_of(cell):
    """The tables that a cell left."""
    return " ".join(output.data.get("text/html", "") for output in cell.outputs if "data" in output)


def assert_shows_progress(cell):
    """One output that changed in its place, at its end with the whole mesh; and no red lines."""
    assert not [output for output in cell.outputs if output.output_type == "stream"]
    (bar,) = [output for output in cell.outputs if output.output_type == "display_data"]
    html = bar.data["text/html"]
    assert html.startswith("<div>surface") and 'value="100"' in html and "done, round" in html
    (data,) = re.findall(r'src="data:image/png;base64,([^"]+)"', html)
    picture = matplotlib.image.imread(io.BytesIO(base64.b64decode(data)))
    drawn = (picture[:, :, :3] < 0.9).any(axis=2).mean()
    assert 0.15 < drawn < 0.9, drawn


def test_the_notebook_runs(repository, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(repository / "clients" / "python"))
    monkeypatch.delenv("MPLBACKEND", raising=False)  # the kernel has its own, which shows figures
    folder = repository / "examples" / "notebook"
    notebook = nbformat.read(folder / "surface.ipynb", as_version=4)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert not any(cell.outputs for cell in code)  # as it is kept
    run = nbclient.NotebookClient(notebook, kernel_name="python3", timeout=200)
    run.execute(cwd=str(folder))
    define, check, mesh, report, picture, genus, curve = code
    assert "keeps its contract" in html_of(check)
    assert "2 in R^3" in html_of(mesh) and "a closed orientable manifold" in html_of(mesh)
    assert_shows_progress(mesh)
    assert "CERTIFIED" in html_of(report) and "NOT CERTIFIED" not in html_of(report)
    assert any("image/png" in output.data for output in picture.outputs if "data" in output)
    assert genus.outputs[0].data["text/plain"] == "5"
    assert any("image/png" in output.data for output in curve.outputs if "data" in output)
    assert "1 in R^3" in html_of(curve)
    assert os.listdir(folder) == ["surface.ipynb"]
