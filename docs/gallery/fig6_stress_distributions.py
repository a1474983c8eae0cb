"""
Stresses along the rim
======================

Remake Fig. 6 of Iagnemma & Dubowsky (2002): stresses along the rim for two slips and three sinkage exponents.

::

    python docs/gallery/fig6_stress_distributions.py OUT.png
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from bevameter.framework.core.vehicle import Wheel
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import normal_stress, shear_stress

WHEEL = Wheel(radius_m=0.25, width_m=0.2)
ENTRY_ANGLE = np.radians(40.0)


def main(out: Path) -> dict[str, float]:
    """Draw the figure; give the peak normal stress [kPa] of each exponent."""
    theta = np.linspace(0.0, ENTRY_ANGLE, 400)
    figure, panels = plt.subplots(1, 2, figsize=(9.0, 3.8), sharey=True, layout="constrained")
    peaks = {}
    for panel, slip in zip(panels, (0.1, 0.6), strict=True):
        for n, colour in ((0.6, "#1b6ca8"), (0.9, "#c4572e"), (1.2, "#3a7d44")):
            soil = Soil(c_Pa=1e3, phi_rad=np.radians(30.0), k_m=0.02, stiffness_Pa=70e3 + 600e3 * WHEEL.width_m, n=n)
            sigma = normal_stress(theta, ENTRY_ANGLE, soil, WHEEL) / 1e3
            tau = shear_stress(theta, ENTRY_ANGLE, slip, soil, WHEEL) / 1e3
            panel.plot(np.degrees(theta), sigma, color=colour, label=f"n = {n:g}")
            panel.plot(np.degrees(theta), tau, color=colour, linestyle="--")
            peaks[f"n = {n:g}"] = float(sigma.max())
        panel.set(title=f"slip {slip:g}", xlabel="angle from the vertical, theta [deg]")
        panel.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("stress [kPa]")
    panels[0].legend(frameon=False)
    panels[1].annotate(
        "normal stress (solid)\nshear stress (dashed)", (0.98, 0.85), xycoords="axes fraction", ha="right"
    )
    figure.suptitle("Simulated: stresses along the rim, Eq. 5, 8 and 9")
    figure.savefig(out, dpi=110)
    plt.close(figure)
    return peaks


if __name__ == "__main__":
    print(main(Path(sys.argv[1])))
