"""Every script of docs/figures draws its picture, and the one that the pages show is that picture."""

from __future__ import annotations

import pathlib
import subprocess
import sys
import tempfile

import numpy as np
from PIL import Image, ImageOps

FIGURES = pathlib.Path(__file__).resolve().parents[2] / "docs" / "figures"
SCRIPTS = sorted(path for path in FIGURES.glob("*.py") if not path.stem.startswith("_"))
# Of 255, on average over a picture. Where another font or renderer moves all edges by a pixel it is 4;
# of a line drawing and its mirror image, 9 to 12.
LIKENESS = 6.0


def last_frame(path: pathlib.Path) -> Image.Image:
    """Of an animation, whose other frames depend on when it was looked at: how it ends."""
    picture = Image.open(path)
    picture.seek(getattr(picture, "n_frames", 1) - 1)
    return picture


def difference(one: pathlib.Path, other: pathlib.Path) -> float:
    pictures = [last_frame(path).convert("L") for path in (one, other)]
    if pictures[0].size != pictures[1].size:
        return 255.0
    values = [np.asarray(picture, dtype=float) for picture in pictures]
    return float(np.abs(values[0] - values[1]).mean())


def main() -> int:
    wrong = []
    pictures = {path.stem: path for path in FIGURES.iterdir() if path.suffix in (".png", ".gif")}
    drawn = {path.stem for path in SCRIPTS}
    undrawn = sorted(pictures.keys() - drawn)
    wrong += [f"no script draws docs/figures/{pictures[name].name}" for name in undrawn]
    with tempfile.TemporaryDirectory() as folder:
        for script in SCRIPTS:
            subprocess.run(["/usr/bin/python3", "-B", script, folder], check=True)
            shown = pictures[script.stem]
            apart = difference(pathlib.Path(folder) / shown.name, shown)
            print(f"{script.stem}: {apart:.1f} of 255 from the one that is shown")
            if apart > LIKENESS:
                wrong.append(f"{shown.name} is not what {script.name} draws now: run it")
        # That it can fail at all.
        mirrored = pathlib.Path(folder) / "mirrored.png"
        ImageOps.mirror(Image.open(FIGURES / "rules.png").convert("RGB")).save(mirrored)
        assert difference(mirrored, FIGURES / "rules.png") > LIKENESS
    print("\n".join(wrong))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
