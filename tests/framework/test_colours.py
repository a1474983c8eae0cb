"""Colours of classes are told apart by people who lack one kind of cones, too."""

from __future__ import annotations

from itertools import combinations

import cv2
import numpy as np
import pytest
from bevameter.framework.colours import COLOURS, FURTHER_COLOURS, UNKNOWN_COLOUR, class_colours
from matplotlib.colors import to_rgb

LEAST_DIFFERENCE = 12.0
"""In CIELAB (1976): 2.3 is just noticeable side by side."""

# G. M. Machado, M. M. Oliveira, L. A. F. Fernandes, IEEE Trans. Vis. Comput. Graph. 15 (2009), 1291: severity 1.
VISION = {
    "usual": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


def seen(colours, matrix) -> np.ndarray:
    """CIELAB of colours, as such eyes see them."""
    rgb = np.array([to_rgb(each) for each in colours])
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4) @ np.array(matrix).T
    linear = np.clip(linear, 0.0, 1.0)
    again = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return cv2.cvtColor(again[None].astype(np.float32), cv2.COLOR_RGB2LAB)[0]


@pytest.mark.parametrize("vision", VISION)
@pytest.mark.parametrize("palette", [tuple(COLOURS.values()), FURTHER_COLOURS], ids=["usual classes", "others"])
def test_every_two_classes_differ(palette, vision):
    lab = seen([*palette, UNKNOWN_COLOUR], VISION[vision])
    least = min(float(np.linalg.norm(a - b)) for a, b in combinations(lab, 2))
    assert least > LEAST_DIFFERENCE


def test_every_class_has_a_colour():
    names = [f"class {number}" for number in range(12)] + ["sand"]
    assert set(class_colours(names)) == set(names)
    assert class_colours(names)["sand"] == COLOURS["sand"]
