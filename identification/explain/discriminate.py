"""Experimental design: the measurement that best separates two hypotheses.

The expected gain is the difference in log-likelihood if one hypothesis is true and the other is refitted. It is
computed for one more channel, for a soil test, for other drives, and for a check of an instrument.
"""

from __future__ import annotations

import numpy as np

from ..effects.drive import select_rows
from ..effects.effect import PULL, SINKAGE, TORQUE, Drive
from ..effects.registry import REGISTRY
from ..mechanics.augmented import SOIL_COUNT
from ..mechanics.textbook import CHANNELS
from .fit import Fitted
from .likelihood import Problem
from .search import Hypothesis
from .steps import normal_equations, scaled_inverse

_NAMES = {TORQUE: "wheel torque", SINKAGE: "sinkage", PULL: "drawbar pull"}
_NEW_SENSOR_NOISE = 0.01
"""Noise of an additional channel, relative to its root mean square [-]."""

_ROWS = 240
LEAST_GAIN = 5.0
"""Least expected gain of a measurement that is proposed [nats]."""

_COVERED = 0.85
"""Share of a planned range beyond which the recorded drive covers it [-]."""

_VARIED = 0.05
"""Standard deviation relative to the mean from which on a condition of a drive varied [-]."""

_SHEAR_TEST = "give cohesion and friction from a shear test (--soil)"


def propose_measurement(problem: Problem, right: Hypothesis, *others: Hypothesis) -> str:
    """Propose the measurement that separates a set of effects from most others, with its expected gain in nats.

    The others that it separates are named unless it is all; empty if it is none. Without others the form of the set is
    in doubt, which a soil test checks.
    """
    if not others:
        return "" if problem.known.values else f"{_SHEAR_TEST} and compare: the soil agrees if the form is right"
    proposals = [
        (text, number, nats)
        for number, other in enumerate(others)
        for propose in (_channels, _known_soil, _drives, _checks)
        for nats, text in propose(problem, right, other)
        if nats >= LEAST_GAIN
    ]
    # By proposal, the expected gain over each of the others.
    separated: dict[str, dict[int, float]] = {}
    for text, number, nats in proposals:
        separated.setdefault(text, {})[number] = nats
    if not separated:
        return ""
    text, nats = max(separated.items(), key=lambda pair: (len(pair[1]), min(pair[1].values())))
    *names, last = dict.fromkeys(_difference(right, others[number]) for number in nats)
    which = f"{', '.join(names)} and {last}" if names else last
    only = "" if len(nats) == len(others) else f", against {which} only"
    return f"{text} (expected gain {min(nats.values()):.0f} nats{only})"


def _difference(right: Hypothesis, other: Hypothesis) -> str:
    """Name the effects that another set has and the true one has not."""
    return " with ".join(sorted(REGISTRY[slug].title for slug in other.slugs - right.slugs or other.slugs))


def _channels(problem: Problem, right: Hypothesis, other: Hypothesis) -> list[tuple[float, str]]:
    """The same drive with one more channel."""
    answer = []
    drive, imposed = problem.samples.drive, problem.imposed
    for channel in (PULL, TORQUE, SINKAGE):
        if channel in problem.answers:
            continue
        noise = np.full(5, np.nan)
        noise[problem.answers] = right.fitted.noise.sd
        truth = right.fitted.model.predict(drive, imposed, right.fitted.vector, right.fitted.theta_1).channels
        noise[channel] = _NEW_SENSOR_NOISE * float(np.sqrt(np.nanmean(truth[:, channel] ** 2))) + 1e-12
        nats = _expected(drive, imposed, noise, right.fitted, other.fitted, None)
        answer.append((nats, f"measure {_NAMES[channel]} ({CHANNELS[channel]}) on the same drive"))
    return answer


def _known_soil(problem: Problem, right: Hypothesis, other: Hypothesis) -> list[tuple[float, str]]:
    """Cohesion and friction from a shear test of 10 % accuracy, unless they are known."""
    if {"c_Pa", "phi_rad"} <= set(problem.known.values):
        return []
    (a, a_variance), (b, b_variance) = (
        (each[:, :2] for each in _soils(problem, hypothesis)) for hypothesis in (right, other)
    )
    accuracy = np.maximum(0.1 * a, (100.0, 0.0))
    gains = 0.5 * np.sum((a - b) ** 2 / (accuracy**2 + a_variance + b_variance), axis=1)
    return [(float(gains.max()), _SHEAR_TEST)]


def _soils(problem: Problem, hypothesis: Hypothesis) -> tuple[np.ndarray, np.ndarray]:
    """Soils of the grounds (g, 5) and their variances (g, 5)."""
    fitted = hypothesis.fitted
    variance = np.diag(fitted.covariance(problem))[fitted.model.soils]
    return fitted.vector[fitted.model.soils].reshape(-1, SOIL_COUNT), variance.reshape(-1, SOIL_COUNT)


def _checks(problem: Problem, right: Hypothesis, other: Hypothesis) -> list[tuple[float, str]]:
    """A check of an instrument that is faulty under one hypothesis only."""
    answer = []
    for hypothesis, without in ((right, other), (other, right)):
        for effect, where in hypothesis.fitted.model.slices():
            noise = problem.samples.noise.copy()
            noise[problem.answers] = hypothesis.fitted.noise.sd
            sd = effect.check_sd(noise)
            if sd is not None and effect.slug not in without.slugs:
                answer.append((0.5 * (float(hypothesis.fitted.vector[where][0]) / sd) ** 2, effect.check))
    return answer


def _drives(problem: Problem, right: Hypothesis, other: Hypothesis) -> list[tuple[float, str]]:
    """Other drives with the same sensors: loads, slips, speeds, passes or slopes that were not driven yet.

    Their gain is relative to as many more rows of the present drive.
    """
    samples = problem.samples
    load, slip = problem.imposed[:, 0], problem.imposed[:, 1]
    grid = np.linspace(0.0, 1.0, _ROWS)
    middle = float(np.median(load))
    speed = samples.drive.rim_speed_m_s
    usual_speed = float(np.nanmedian(np.abs(speed))) if np.isfinite(speed).any() else 0.1
    low, high = np.quantile(slip, [0.05, 0.95])

    def sweep(first: float, last: float, turns: int) -> np.ndarray:
        return first + (last - first) * np.abs((grid * turns * 2.0) % 2.0 - 1.0)

    plans = {
        "drive with loads from half to one and a half of the present ones": (
            "load", dict(load=middle * sweep(0.5, 1.5, 5), slip=sweep(low, high, 13))
        ),
        "drive with slips from 0 to 0.6": (
            "slip", dict(slip=sweep(0.0, 0.6, 7), load=np.interp(grid, [0, 1], [load.min(), load.max()]))
        ),
        "drive at speeds from a third to three times the present one": (
            "speed", dict(speed=usual_speed * 3.0 ** sweep(-1.0, 1.0, 3), slip=sweep(low, high, 13))
        ),
        "drive twice more in the same rut": (
            "number", dict(number=1.0 + np.floor(grid * 2.999), slip=sweep(low, high, 9))
        ),
        "drive on slopes from -10 to 10 degrees, pitch measured": (
            "pitch", dict(pitch=np.radians(sweep(-10.0, 10.0, 3)), slip=sweep(low, high, 11))
        ),
    }  # fmt: skip
    noise = np.full(5, np.nan)
    noise[problem.answers] = right.fitted.noise.sd
    answer = []
    driven = samples.drive
    before = {
        "load": load, "slip": slip, "speed": np.log(np.where(speed == 0.0, np.nan, np.abs(speed))),
        "number": driven.pass_number, "pitch": driven.pitch_rad,
    }  # fmt: skip
    along = np.linspace(0, len(load) - 1, _ROWS).round().astype(int)
    same_drive = _expected(
        select_rows(driven, along), problem.imposed[along], noise, right.fitted, other.fitted, problem
    )  # fmt: skip
    for text, (varied, plan) in plans.items():
        planned = np.log(plan["speed"]) if varied == "speed" else plan[varied]
        if _covers(before[varied], planned):
            continue
        imposed = np.column_stack([plan.get("load", np.full(_ROWS, middle)), plan.get("slip", np.full(_ROWS, 0.2))])
        drive = _hypothetical(samples.drive, imposed, plan, usual_speed, samples.wheel.radius_m)
        nats = _expected(drive, imposed, noise, right.fitted, other.fitted, problem)
        answer.append((nats - same_drive, text))
    return answer


def _covers(before: np.ndarray, planned: np.ndarray) -> bool:
    """Return whether the known values (n,) of a drive cover those planned (m,)."""
    known = before[np.isfinite(before)]
    if not len(known):
        return False
    low, high = np.quantile(known, [0.05, 0.95])
    return bool(min(high, planned.max()) - max(low, planned.min()) > _COVERED * np.ptp(planned))


def _hypothetical(drive: Drive, imposed: np.ndarray, plan: dict, usual_speed: float, radius: float) -> Drive:
    rows = len(imposed)
    rim = plan.get("speed", np.full(rows, usual_speed))
    time_s = (
        np.linspace(np.nanmin(drive.time_s), np.nanmax(drive.time_s), rows)
        if np.isfinite(drive.time_s).any()
        else np.full(rows, np.nan)
    )
    # On the same ground.
    along = np.linspace(0, len(drive.slip) - 1, rows).round().astype(int)
    place, x_m, y_m = (each[along] for each in (drive.place_m, drive.x_m, drive.y_m))
    return Drive(
        load_N=imposed[:, 0], slip=imposed[:, 1], time_s=time_s, travel_speed_m_s=rim * (1.0 - imposed[:, 1]),
        rim_speed_m_s=rim, wheel_angle_rad=np.linspace(0.0, 8.0 * np.pi, rows),
        pitch_rad=plan.get("pitch", np.zeros(rows)), pass_number=plan.get("number", np.ones(rows)), place_m=place,
        x_m=x_m, y_m=y_m,
        acceleration_m_s2=np.zeros(rows), angular_acceleration_rad_s2=np.zeros(rows),
        stretch=np.zeros(rows, dtype=int), run=np.zeros(rows, dtype=int),
        slip_before=np.full(rows, np.abs(imposed[:, 1]).mean()), ground=drive.ground[along],
        wheel=drive.wheel[along],
    )  # fmt: skip


def _expected(
    drive: Drive, imposed: np.ndarray, noise: np.ndarray, right: Fitted, other: Fitted, problem: Problem | None
) -> float:
    """Expected loss in log-likelihood of the other hypothesis, refitted, if one is true [nats]."""
    seen = np.flatnonzero(np.isfinite(noise))
    truth = right.model.predict(drive, imposed, right.vector).channels[:, seen]
    answer = other.model.linearise(drive, imposed, other.vector, None)
    difference = (truth - answer.channels[:, seen]) / noise[seen]
    columns = answer.by_parameter[:, seen] / noise[seen, None]
    good = np.asarray(np.isfinite(difference).all(axis=1) & np.isfinite(columns).all(axis=(1, 2)))
    if good.sum() < 0.5 * len(good):
        return 0.0
    difference = difference[good]
    gradient, information = normal_equations(
        difference, columns[good], drive.ground[good], other.model.grounds, np.ones_like(difference)
    )
    if problem is not None:
        # The fit to the present drive is the prior for a new one.
        information += scaled_inverse(other.covariance(problem))
    return 0.5 * float(np.sum(difference**2) - gradient @ scaled_inverse(information) @ gradient)


def propose_drive(drive: Drive, variable: str) -> str:
    """Propose a drive that identifies what a discrepancy depends on.

    It varies the variable alone if other conditions varied with it, else it repeats the drive at another value of a
    condition that was constant.
    """
    conditions = ("load_N", "rim_speed_m_s", "slip")
    varied = [name for name in conditions if drive.has(name) and _varies(getattr(drive, name))]
    others = [name for name in varied if name != variable]
    if others:
        return f"vary {variable} with {' and '.join(others)} held constant"
    constant = next(name for name in conditions if name not in varied)
    return f"repeat the drive at another {constant}"


def _varies(values: np.ndarray) -> bool:
    """Return whether a condition (n,) varied."""
    return bool(np.nanstd(values) > _VARIED * abs(np.nanmean(values)))
