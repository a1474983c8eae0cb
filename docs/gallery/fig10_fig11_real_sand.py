"""
Soil of dry sand and its drawbar pull (real recording)
======================================================

What Fig. 10 and 11 of Iagnemma & Dubowsky (2002) show, on a real recording: soil of dry sand, and its drawbar pull.

The paper's testbed data were not published; this uses the single-wheel recording in dry sand of Pavlov (Carnegie
Mellon Robomechanics Lab, MIT licence): steady-state trials without torque, so that the paper's Eq. 22 does not apply.

::

    python docs/gallery/fig10_fig11_real_sand.py WHEEL.csv OUT.png
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from bevameter import identify, read_recording
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import equilibrium
from bevameter.identification.rows.select import select_wheel_rows


def main(wheel_file: Path, out: Path) -> dict[str, float]:
    """Draw the figure; give the estimates and the rms error of the drawbar pull, share of the load."""
    recording = read_recording(wheel_file)
    result = identify(recording)
    assert result.overall is not None
    rows = select_wheel_rows(recording)
    driving = rows.table.select(rows.reasons == "")
    quantities = result.overall.parameters
    soil = Soil(**{name: quantity.value for name, quantity in quantities.items()})
    state = equilibrium(rows.wheel, soil, driving["load_N"], driving["slip"])

    figure, panels = plt.subplots(1, 3, figsize=(13.0, 3.8), layout="constrained")
    c, phi = quantities["c_Pa"], quantities["phi_rad"]
    degrees = 180.0 / np.pi
    panels[0].errorbar(
        [c.value / 1e3], [phi.value * degrees],
        xerr=[[(c.value - c.low) / 1e3], [(c.high - c.value) / 1e3]],
        yerr=[[(phi.value - phi.low) * degrees], [(phi.high - phi.value) * degrees]],
        fmt="o", color="#1b6ca8", capsize=3, label="identified, 95 %",
    )  # fmt: skip
    panels[0].axhline(29.0, color="0.5", lw=1, label="angle of repose")
    panels[0].axvspan(0.0, 1.0, color="0.9", label="loose sand, published")
    panels[0].set(xlabel="cohesion c [kPa]", ylabel="friction angle phi [deg]", xlim=(-0.2, 4.0), ylim=(0.0, 45.0))
    panels[0].legend(frameon=False, loc="lower right")
    for panel, name, scale, predicted in (
        (panels[1], "sinkage_m", 1e3, state.sinkage_m), (panels[2], "drawbar_pull_N", 1.0, state.drawbar_pull_N),
    ):  # fmt: skip
        panel.plot(driving["slip"], scale * driving[name], "o", color="black", label="measured")
        panel.plot(driving["slip"], scale * predicted, "x", color="#c4572e", label="textbook wheel, fitted")
        panel.set(xlabel="slip [-]", ylabel={"sinkage_m": "sinkage [mm]"}.get(name, "drawbar pull [N]"))
        panel.legend(frameon=False)
    for panel in panels:
        panel.spines[["top", "right"]].set_visible(False)
    figure.suptitle(f"Real: smooth wheel in dry sand, {result.overall.n} driving trials, straight ahead")
    figure.savefig(out, dpi=100)
    plt.close(figure)
    error = driving["drawbar_pull_N"] - state.drawbar_pull_N
    return {
        "phi_deg": phi.value * degrees,
        "c_Pa": c.value,
        "drawbar_pull_rms_share_of_load": float(np.sqrt(np.mean(error**2)) / np.mean(driving["load_N"])),
    }


if __name__ == "__main__":
    print(main(Path(sys.argv[1]), Path(sys.argv[2])))
