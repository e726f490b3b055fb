"""Four pictures of the gallery side by side: what README shows first."""

from __future__ import annotations

import _drawing as drawing
import matplotlib.pyplot as plt
from PIL import Image, ImageChops

GALLERY = drawing.HERE.parent / "gallery"
SHOWN = {
    "rotations": "SO(3), cut open\nk = 3 in R$^9$",
    "linkage": "all positions of a linkage\nk = 2 in R$^6$",
    "drilled_and_joined": "a drilled part, sharp edges kept\nk = 3 in R$^3$",
    "neural": "where a neural network is zero\nk = 2 in R$^3$",
}


def trimmed(name: str) -> Image.Image:
    """The picture without its white margin."""
    picture = Image.open(GALLERY / f"{name}.png").convert("RGB")
    box = ImageChops.difference(picture, Image.new("RGB", picture.size, "white")).getbbox()
    return picture.crop(box)


figure = plt.figure(figsize=(10, 3))
for place, (name, words) in enumerate(SHOWN.items()):
    axes = figure.add_axes((place / 4 + 0.02, 0.22, 0.21, 0.76))
    axes.imshow(trimmed(name), interpolation="lanczos")
    axes.set_axis_off()
    figure.text(place / 4 + 0.125, 0.03, words, ha="center", va="bottom", fontsize=10)
drawing.save(figure, "first")
