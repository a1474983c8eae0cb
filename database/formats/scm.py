"""Soils of the classes as parameters of Project Chrono's deformable terrain.

`SCMTerrain::SetSoilParameters` (projectchrono/chrono, src/chrono_vehicle/terrain/SCMTerrain.cpp) takes Bekker's
pressure-sinkage curve ``sigma = (Kc / b + Kphi) z^n`` (M. G. Bekker, "Introduction to Terrain-Vehicle Systems" (1969)),
in which b comes from the contact patch's perimeter and area. Wheels of one width b determine Reece's
``sigma = S (z / b)^n``, S = k1 + k2 b (Iagnemma & Dubowsky 2002, Eq. 6), and not k1 and k2 by themselves. The two are
the same curve where ``Kc / b + Kphi = S / b^n``. With Kc = 0 and ``Kphi = S / b^n`` [N/m^(n + 2)] it holds for wheels
of this width, however Chrono estimates b.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from ...framework.core.arguments import number, refused
from ...framework.core.errors import InputError
from ...framework.core.files import write_text
from ..exporters import SETTINGS, Exporter, Request, register
from ..posterior import ClassSoil
from ..snapshot import Snapshot

_NEEDED = {"log_k": "shear modulus k", "log_stiffness": "stiffness", "n": "sinkage exponent n"}


@register
class ChronoScm(Exporter):
    """Soil parameters by class, as JSON."""

    name = "scm"
    endings = (".json",)
    holds = "soil parameters of Chrono's SCMTerrain by class"
    settings = ("wheel_width_m", "elastic_stiffness_Pa_m", "damping_Pa_s_m")

    def write(self, request: Request, out: Path) -> None:
        """Write `scm_page`; what no wheel measures has to be stated."""
        width, elastic, damping = (request.stated(name) for name in self.settings)
        page = scm_page(request.view, wheel_width_m=width, elastic_stiffness_Pa_m=elastic, damping_Pa_s_m=damping)
        write_text(json.dumps(page, indent=1, ensure_ascii=False, allow_nan=False) + "\n", out)


def scm_page(
    view: Snapshot, *, wheel_width_m: float, elastic_stiffness_Pa_m: float, damping_Pa_s_m: float
) -> dict[str, Any]:
    """Give the soil parameters of every class whose soil is known, and why not of the others.

    Parameters
    ----------
    view
        What is known of the site.
    wheel_width_m
        Width of the wheels that measured the soil [m].
    elastic_stiffness_Pa_m, damping_Pa_s_m
        ``elastic_K`` [Pa/m] and ``damping_R`` [Pa s/m]: how the soil unloads and damps, which wheels in steady motion
        do not show.

    Returns
    -------
    dict
        ``classes``: by class the eight arguments by their names in Chrono; the expected c and tan phi, the medians of
        k and stiffness and the mean of n of a place of the class. ``refused``: by class the reason. ``notes``: by
        class what the parameters leave out.

    Raises
    ------
    InputError
        A setting that is no number or out of range, an elastic stiffness below Kphi (Chrono would replace it), or no
        class whose soil is known.
    """
    width = _positive("wheel_width_m", wheel_width_m)
    elastic = _positive("elastic_stiffness_Pa_m", elastic_stiffness_Pa_m)
    damping = _positive("damping_Pa_s_m", damping_Pa_s_m, zero=True)
    reasons = {name: _refusal(name, view.soils.get(name)) for name in view.class_names}
    known = [name for name, reason in reasons.items() if not reason]
    if not known:
        raise InputError("site", f"no class of {view.site!r} has a known soil", expected="soil that wheels measured")
    classes = {name: _parameters(view.soils[name], width, elastic, damping) for name in known}
    for name, values in classes.items():
        if values["Bekker_Kphi"] > elastic:
            raise InputError(
                SETTINGS["elastic_stiffness_Pa_m"][0],
                f"{elastic:g}",
                expected=f"at least Bekker_Kphi of class {name}, {values['Bekker_Kphi']:.3g}: Chrono would replace it",
            )
    return {
        "schema": 1,
        "site": view.site,
        "wheel_width_m": width,
        "classes": classes,
        "refused": {name: reason for name, reason in reasons.items() if reason},
        "notes": {name: notes for name in known if (notes := _notes(view, name))},
    }


def bekker_kphi(stiffness_Pa: float, n: float, wheel_width_m: float) -> float:
    """Convert the stiffness of (sinkage / width)^n [Pa] to that of sinkage^n: S / b^n [N/m^(n + 2)]."""
    return stiffness_Pa / wheel_width_m**n


def _parameters(soil: ClassSoil, width: float, elastic: float, damping: float) -> dict[str, float]:
    n = float(soil.others["n"].mean[0])
    stiffness = math.exp(soil.others["log_stiffness"].mean[0])
    return {
        "Bekker_Kphi": bekker_kphi(stiffness, n, width),
        "Bekker_Kc": 0.0,
        "Bekker_n": n,
        "Mohr_cohesion": float(soil.strength.mean[0]),
        "Mohr_friction": math.degrees(math.atan(soil.strength.mean[1])),
        "Janosi_shear": math.exp(soil.others["log_k"].mean[0]),
        "elastic_K": elastic,
        "damping_R": damping,
    }


def _refusal(name: str, soil: ClassSoil | None) -> str:
    """Say why a class has no parameters; empty where it has."""
    if soil is None:
        return f"no soil data for class {name}"
    missing = [text for key, text in _NEEDED.items() if key not in soil.others]
    if missing:
        return f"no {' and no '.join(missing)} known of class {name}"
    cohesion, tan_phi = soil.strength.mean
    if cohesion < 0 or tan_phi < 0:
        return f"c = {cohesion:g} Pa and tan phi = {tan_phi:g} of class {name} are not both positive"
    return ""


def _notes(view: Snapshot, name: str) -> list[str]:
    """Say what the textbook's soil leaves out on a class."""
    notes = []
    if view.soils[name].misfits:
        notes.append("the textbook wheel does not fit the measurements")
    if name in view.physics:
        slugs = ", ".join(effect.slug for effect in view.physics[name].effects)
        notes.append(f"known beyond the textbook, and not in these parameters: {slugs}")
    return notes


def _positive(name: str, value: float, *, zero: bool = False) -> float:
    label, meaning = SETTINGS[name]
    expected = f"a finite, {'not negative' if zero else 'positive'} number: {meaning}"
    found = number(label, value, expected)
    if not (math.isfinite(found) and (found > 0 or (zero and found == 0))):
        raise refused(label, value, expected)
    return found
