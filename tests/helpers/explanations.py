"""Prepared answers of `explain` for tests of the report and of the command."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from bevameter import Wheel
from bevameter.framework.core.sound_explanation import SoundCause, SoundFindings, SoundRegion, SpectralFit
from bevameter.identification.effects.parse import forms_by_name, specimen
from bevameter.identification.explain.explanation import (
    Candidate,
    ChannelFit,
    Estimate,
    ExplainedGround,
    Explanation,
    Missing,
    Region,
    Rows,
)
from bevameter.identification.mechanics.augmented import AugmentedWheel

N1 = {"n1": Estimate(0.2134, 0.0189)}
SOIL = {"c_Pa": Estimate(512.0, 83.0, "Pa"), "phi_rad": Estimate(np.radians(30.0), np.radians(0.9), "rad")}
SOIL_TEXTBOOK = {"c_Pa": Estimate(2100.0, 300.0, "Pa"), "phi_rad": Estimate(np.radians(21.0), 0.03, "rad")}
EQUATION = "n = n0 + n1 |i|"
ROWS = 400


def rows(seed: int = 0) -> Rows:
    """Rows of a drive whose sinkage grows with slip, whose torque ripples, and a few of which were not observed."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(ROWS) / 10.0
    slip = 0.3 + 0.25 * np.sin(time_s / 1.7)
    angle = 1.5 * time_s
    truth = np.column_stack([12.0 + 20.0 * slip, 0.02 + 0.03 * slip, 30.0 + 60.0 * slip])
    noise = np.array([0.5, 5e-4, 3.0])
    measured = truth + noise * rng.normal(size=truth.shape)
    before = truth.copy()
    before[:, 1] -= 0.02 * np.maximum(slip - 0.3, 0.0)
    before[:, 0] -= 1.5 * np.cos(12.0 * angle)
    measured[5:9, 1] = np.nan
    measured[200, 2] += 60.0
    variables = {"slip": slip, "time_s": time_s, "wheel_angle_rad": angle, "pass": 1.0 + (time_s > 20.0)}
    return Rows(("torque_Nm", "sinkage_m", "drawbar_pull_N"), variables, measured, before, truth, noise)


def explanation(**changes) -> Explanation:
    """Slip-sinkage, named with certainty; `changes` are fields of `Explanation`."""
    drive = rows()
    found = next(each for each in forms_by_name("slip_sinkage", specimen()) if each.form == "exponent")
    answer = Explanation(
        source="somewhere/wheel.csv",
        verdict="physics",
        summary="Sinkage leaves the simulation above slip 0.3.",
        grounds=(ExplainedGround("", -math.inf, math.inf, ROWS, SOIL, SOIL_TEXTBOOK),),
        trust="Held-out rows are predicted to within noise.",
        located=(
            Region("sinkage_m", "slip", 0.3, 0.55, 0.97, 1e-30, 6.2),
            Region("torque_Nm", "wheel_angle_rad", 0.0, 2.0 * np.pi / 12.0, 1.0, 2e-9, 2.1),
        ),
        missing=(Missing("slip_sinkage", "physics", "exponent", 0.98, N1, EQUATION, "Ding et al. (2010)"),),
        candidates=(
            Candidate("slip_sinkage[exponent]", "physics", 0.98, 236.0, 240.0, N1),
            Candidate("bulldozing[wedge]", "physics", 1e-9, -1.5, -2.0, {"s": Estimate(0.1, 0.4)}),
        ),
        fits={
            "torque_Nm": ChannelFit(1.2, 0.52, 0.5, ROWS, (1.1, 1.3), (0.48, 0.55)),
            "sinkage_m": ChannelFit(2.8e-3, 5.1e-4, 5e-4, ROWS - 4, (2.4e-3, 3.3e-3), (4.8e-4, 5.6e-4)),
            "drawbar_pull_N": ChannelFit(3.2, 3.1, 3.0, ROWS, (2.8, 3.5), (2.8, 3.4)),
        },
        split="12 stretches of time held out in turn",
        heldout_nats=Estimate(240.0, 21.0),
        notes=("3 rows without load or slip are left out",),
        rows=drive,
        simulator=AugmentedWheel(Wheel(radius_m=0.15, width_m=0.12), (found,)),
        vector=np.array([512.0, 0.577, -4.0, 12.0, 0.0, N1["n1"].value]),
        believed={"slip_sinkage": 0.98},
        seconds=12.3,
        seed=7,
        n=ROWS,
    )
    return replace(answer, **changes)


def with_soil(answer: Explanation, **soil: Estimate) -> Explanation:
    """Return the answer with these values of the soil."""
    ground = answer.grounds[0]
    return replace(answer, grounds=(replace(ground, soil={**ground.soil, **soil}),))


def nothing() -> Explanation:
    """Nothing beyond noise."""
    return explanation(
        verdict="none", located=(), missing=(), heldout_nats=Estimate(0.0, 0.0), summary="They agree.",
        fits={name: replace(fit, rmse_before=fit.rmse_after) for name, fit in explanation().fits.items()},
    )  # fmt: skip


def cannot_tell() -> Explanation:
    """Two causes that the data do not separate."""
    first = Missing(
        "side_wall_friction", "physics", "stress", 0.55, {"tau_s": Estimate(900.0, 200.0, "Pa")}, "T += 2 tau_s A r",
        "Ding et al. (2009)", ("torque_gain",), "measure drawbar pull (drawbar_pull_N) on the same drive",
    )  # fmt: skip
    second = Missing(
        "torque_gain", "instrument", "", 0.42, {"g": Estimate(0.08, 0.02)}, "T reported = (1 + g) T", "definition",
        ("side_wall_friction",), "measure drawbar pull (drawbar_pull_N) on the same drive",
    )  # fmt: skip
    weighed = tuple(Candidate(each.effect, each.kind, each.probability, 62.0, 60.0, {}) for each in (first, second))
    return explanation(verdict="cannot_tell", missing=(first, second), candidates=weighed)


def unknown() -> Explanation:
    """Something that the catalogue lacks."""
    lacked = Missing(
        "unknown", "unknown", "smooth discrepancy", 0.93, {}, "a polynomial in what the drive varies", "somebody",
        would_tell="vary rim_speed_m_s with load_N held constant",
        description="torque_Nm differs by 3 times its noise, mostly with rim_speed_m_s",
    )  # fmt: skip
    return explanation(verdict="unknown", missing=(lacked,))


def several() -> Explanation:
    """Physics and an instrument's fault that are asserted, and one effect that is not."""
    fault = Missing("time_lag", "instrument", "torque_Nm, low-pass", 0.97, {"tau": Estimate(0.4, 0.02, "s")}, "", "")
    doubtful = Missing("load_gain", "instrument", "", 0.3, {"g": Estimate(0.05, 0.03)}, "", "", would_tell="weigh it")
    return explanation(missing=(*explanation().missing, fault, doubtful))


SOUND = SoundFindings(
    "physics",
    (SoundRegion("wheel_order", 18.0, 18.0, 12.0, 90.0, 0.6, 1e-5),),
    (
        SoundCause(
            "gear_mesh", "physics", "", 0.97, {"order": Estimate(18.0, 0.1, "turns^-1")}, "f = k omega / 2 pi",
            "somebody",
        ),
    ),
    SpectralFit("12 stretches", 8.0, 5.7, 5.6, 900.0, 80.0, 12345),
    ("<i>a note</i>",),
    2.0,
)  # fmt: skip
