"""A segmentation with several labels, as one mesh."""

import numpy as np
import pytest
import stellate
from stellate import solids

SPACING = np.array([1.0, 0.8, 2.0])
MIDDLE = np.array([19.0, 18.0, 20.0])


def segmentation():
    """A ball of radius 14 in mm, label 3, with one of radius 8 beside its middle, label 7."""
    shape = (40, 48, 21)
    at = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1) * SPACING - MIDDLE
    labels = np.where(np.linalg.norm(at, axis=-1) < 14, 3, 0).astype(np.int16)
    labels[np.linalg.norm(at - [3, 2, 0], axis=-1) < 8] = 7
    return labels


def test_two_labels_share_their_interface(server):
    smooth = 3.0
    phases = solids.Phases.of_labels(segmentation(), spacing=SPACING, smooth=smooth)
    assert phases.region_names == ("label_3", "label_7")
    mesh = stellate.mesh(phases, epsilon=3.0, server=server, require_certified=True)
    # A smoothed mask's half is smooth^2 / r within the ball: a sixth of the volume, and two fifths.
    for name, radius in (("label_7", 8), (None, 14)):
        part = mesh if name is None else mesh.region(name)
        expected = 4 / 3 * np.pi * (radius - smooth**2 / radius) ** 3
        assert part.volume == pytest.approx(expected, rel=0.08)


@pytest.mark.parametrize(
    "words, labels, settings",
    [
        ("whole numbers.*float64", segmentation() * 1.0, {}),
        (r"2 to 6 labels beside 0, and here are \[3\]", np.minimum(segmentation(), 3), {}),
        (r"reaches the border.*np\.pad", segmentation()[20:], {}),
        ("one length, some 3 here", segmentation(), {"smooth": 0}),
        ("spacing and origin", segmentation(), {"spacing": (1, 2)}),
        ("spacing has to be positive", segmentation(), {"spacing": 0}),
    ],
)
def test_what_is_no_segmentation_is_said(words, labels, settings):
    given = {"spacing": SPACING, "smooth": 3.0, **settings}
    with pytest.raises(stellate.InvalidArgument, match=words):
        solids.Phases.of_labels(labels, **given)
