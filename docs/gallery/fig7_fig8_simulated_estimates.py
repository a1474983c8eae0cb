"""
Estimates along a simulated drive
=================================

Remake Fig. 7 and 8 of Iagnemma & Dubowsky (2002): estimates along a simulated drive, and the drawbar pull predicted.

The paper's simulated wheel with 10 % noise and k assumed at 300 %. Two estimators run side by side: the paper's linear
least squares (Eq. 22), and maximum likelihood with errors in all channels.

::

    python docs/gallery/fig7_fig8_simulated_estimates.py OUT.png
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from bevameter.framework.core.vehicle import Wheel
from bevameter.identification.estimate.online import OnlineIdentifier
from bevameter.identification.mechanics.linearised import OnlineEstimator, drawbar_pull
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import CHANNELS, equilibrium

WHEEL = Wheel(radius_m=0.5, width_m=0.3)
SOIL = Soil(c_Pa=1e3, phi_rad=np.radians(30.0), k_m=0.005, stiffness_Pa=20e3 + 600e3 * 0.3, n=0.9)
NOISE_SHARE = 0.10


def main(out: Path, samples: int = 300, seed: int = 2) -> dict[str, float]:
    """Draw both figures; give the final estimates and the error of the predicted drawbar pull, without noise."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(samples) / 10.0
    load = 800.0 + 300.0 * np.sin(2.0 * np.pi * time_s / 10.0)
    slip = 0.3 + 0.25 * np.sin(2.0 * np.pi * time_s / 7.3)
    state = equilibrium(WHEEL, SOIL, load, slip)
    truth = np.column_stack([load, state.torque_Nm, state.sinkage_m, slip])
    noise = NOISE_SHARE * np.abs(truth).max(axis=0)
    sensed = truth + noise * rng.normal(size=truth.shape)

    linear = OnlineEstimator(WHEEL, 3.0 * SOIL.k_m)
    likelihood = OnlineIdentifier(WHEEL, dict(zip(CHANNELS[:4], noise, strict=True)))
    by_linear, by_likelihood, low, high = (np.full((samples, 2), np.nan) for _ in range(4))
    for row, sample in enumerate(sensed):
        by_linear[row] = linear.update(*sample)
        estimate = likelihood.update(**dict(zip(CHANNELS[:4], sample, strict=True)))
        if estimate is not None:
            pair = [estimate.parameters[name] for name in ("c_Pa", "phi_rad")]
            by_likelihood[row] = [each.value for each in pair]
            low[row], high[row] = [each.low for each in pair], [each.high for each in pair]
    by_linear[:, 1] = np.arctan(by_linear[:, 1])
    predicted = drawbar_pull(load, state.torque_Nm, state.sinkage_m, WHEEL)

    figure, panels = plt.subplots(1, 3, figsize=(13.0, 3.8), layout="constrained")
    scales = (1e-3, 180.0 / np.pi)
    for column, (label, limits) in enumerate((("cohesion c [kPa]", (-2, 22)), ("friction angle phi [deg]", (0, 60)))):
        panel, scale = panels[column], scales[column]
        panel.fill_between(time_s, scale * low[:, column], scale * high[:, column], color="#1b6ca8", alpha=0.2, lw=0)
        panel.plot(time_s, scale * by_likelihood[:, column], color="#1b6ca8", label="maximum likelihood, 95 %")
        panel.plot(time_s, scale * by_linear[:, column], color="#c4572e", label="linear, Eq. 22")
        panel.axhline(scale * (SOIL.c_Pa, SOIL.phi_rad)[column], color="0.5", lw=1, label="truth")
        panel.set(xlabel="time [s]", ylabel=label, ylim=limits)
    panels[0].legend(frameon=False)
    panels[2].plot(time_s, state.drawbar_pull_N, color="black", label="actual")
    panels[2].plot(time_s, predicted, color="0.6", label="predicted, Eq. 15")
    panels[2].set(xlabel="time [s]", ylabel="drawbar pull [N]")
    panels[2].legend(frameon=False)
    for panel in panels:
        panel.spines[["top", "right"]].set_visible(False)
    figure.suptitle("Simulated: soil estimated along the drive (10 % noise), and drawbar pull from noise-free W, T, z")
    figure.savefig(out, dpi=100)
    plt.close(figure)
    error = np.mean(np.abs(predicted - state.drawbar_pull_N))
    return {
        "c_Pa": float(by_likelihood[-1, 0]),
        "phi_deg": float(np.degrees(by_likelihood[-1, 1])),
        "linear_c_Pa": float(by_linear[-1, 0]),
        "linear_phi_deg": float(np.degrees(by_linear[-1, 1])),
        "drawbar_pull_error_share": float(error / np.mean(state.drawbar_pull_N)),
    }


if __name__ == "__main__":
    print(main(Path(sys.argv[1])))
