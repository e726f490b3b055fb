"""Every script of docs/figures draws its picture, and the one that the pages show is that picture."""

from __future__ import annotations

import pathlib
import subprocess
import sys
import tempfile

import numpy as np
from PIL import Image

FIGURES = pathlib.Path(__file__).resolve().parents[2] / "docs" / "figures"
SCRIPTS = sorted(path for path in FIGURES.glob("*.py") if path.stem != "drawing")
# Of 255, on average over a picture. Another font or renderer moves edges by a pixel; a picture of
# something else is several times as far away.
LIKENESS = 12.0


def difference(one: pathlib.Path, other: pathlib.Path) -> float:
    pictures = [Image.open(path).convert("L") for path in (one, other)]
    if pictures[0].size != pictures[1].size:
        return 255.0
    values = [np.asarray(picture, dtype=float) for picture in pictures]
    return float(np.abs(values[0] - values[1]).mean())


def main() -> int:
    wrong = []
    shown = {path.stem for path in FIGURES.glob("*.png")}
    drawn = {path.stem for path in SCRIPTS}
    wrong += [f"no script draws docs/figures/{name}.png" for name in sorted(shown - drawn)]
    with tempfile.TemporaryDirectory() as folder:
        for script in SCRIPTS:
            subprocess.run(["/usr/bin/python3", "-B", script, folder], check=True)
            picture = pathlib.Path(folder) / f"{script.stem}.png"
            apart = difference(picture, FIGURES / picture.name)
            print(f"{script.stem}: {apart:.1f} of 255 from the one that is shown")
            if apart > LIKENESS:
                wrong.append(f"{picture.name} is not what {script.name} draws now: run it")
        # That it can fail at all.
        two = [pathlib.Path(folder) / f"{script.stem}.png" for script in SCRIPTS[:2]]
        assert difference(*two) > LIKENESS
    print("\n".join(wrong))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
