"""Soil parameters for Chrono's SCMTerrain: the same pressure at the same sinkage, in both programs' formulas."""

import dataclasses
import json
import math
from types import MappingProxyType

import numpy as np
import pytest
from bevameter import AugmentedSimulator, InputError, Wheel
from bevameter.database.exporters import Request, export
from bevameter.database.formats.scm import scm_page
from bevameter.database.snapshot import Snapshot
from bevameter.framework.core.explanation import Estimate
from bevameter.framework.core.soil import PARAMETERS
from bevameter.identification.effects.stored import StoredEffect
from bevameter.identification.mechanics.soil import Soil
from bevameter.identification.mechanics.textbook import normal_stress

STATED = {"wheel_width_m": 0.12, "elastic_stiffness_Pa_m": 4e7, "damping_Pa_s_m": 3e4}


def chrono_pressure(values, sinkage_m, patch):
    """Bekker's formula as SCMTerrain.cpp has it: 1/b is half the patch's perimeter over its area."""
    perimeter, area = patch
    return (perimeter / (2 * area) * values["Bekker_Kc"] + values["Bekker_Kphi"]) * sinkage_m ** values["Bekker_n"]


@pytest.mark.parametrize("n", [0.6, 1.0, 1.4])
@pytest.mark.parametrize("width", [0.05, 0.12, 0.3])
def test_the_pressure_at_a_sinkage_is_the_wheels(make, width, n):
    soils = []
    for index in range(4):
        soil = make.soil({"sand": 1.0}, at_s=10.0 * index)
        parameters = {**soil.estimate.parameters, "n": make.quantity(n, 0.01)}
        soils.append(dataclasses.replace(soil, estimate=dataclasses.replace(soil.estimate, parameters=parameters)))
    view = Snapshot.derive("quarry", [make.drive(soils=tuple(soils))])
    values = scm_page(view, **{**STATED, "wheel_width_m": width, "elastic_stiffness_Pa_m": 1e9})["classes"]["sand"]
    wheel, soil = Wheel(radius_m=0.2, width_m=width), Soil(1000.0, 0.54, 0.025, 8e5, n)
    theta_1, theta = 0.7, np.array([0.36, 0.5, 0.6])  # ahead of the peak: the soil under the rim is pressed for once
    depth = wheel.radius_m * (np.cos(theta) - math.cos(theta_1))
    for patch in ((0.6, 0.02), (2.0, 0.1)):
        np.testing.assert_allclose(
            chrono_pressure(values, depth, patch), normal_stress(theta, theta_1, soil, wheel), rtol=1e-6
        )


def test_all_parameters_of_a_class(view, tmp_path):
    assert export(Request(view, **STATED), tmp_path / "soils.json") == (tmp_path / "soils.json",)
    page = json.loads((tmp_path / "soils.json").read_text(encoding="utf-8"))
    assert (page["schema"], page["site"], page["wheel_width_m"]) == (1, "quarry", 0.12)
    assert page["refused"] == {"asphalt": "no soil data for class asphalt"}
    assert page["notes"] == {}
    sand = view.soils["sand"].strength.mean
    assert page["classes"]["sand"] == pytest.approx(
        {
            "Bekker_Kphi": 8e5 / 0.12, "Bekker_Kc": 0.0, "Bekker_n": 1.0, "Mohr_cohesion": sand[0],
            "Mohr_friction": math.degrees(math.atan(sand[1])), "Janosi_shear": 0.025, "elastic_K": 4e7,
            "damping_R": 3e4,
        },
        rel=1e-6,
    )  # fmt: skip
    assert list(page["classes"]) == ["clay", "sand"]


def test_a_class_that_lacks_a_parameter_is_refused(make):
    soil = make.soil({"sand": 1.0})
    parameters = {name: value for name, value in soil.estimate.parameters.items() if name not in ("k_m", "n")}
    lacking = dataclasses.replace(soil, estimate=dataclasses.replace(soil.estimate, parameters=parameters))
    view = Snapshot.derive("quarry", [make.drive(soils=(lacking, make.soil({"clay": 1.0})))])
    page = scm_page(view, **STATED)
    assert page["refused"] == {"sand": "no shear modulus k and no sinkage exponent n known of class sand"}
    assert list(page["classes"]) == ["clay"]
    with pytest.raises(InputError, match="site: no class of 'quarry' has a known soil"):
        scm_page(Snapshot.derive("quarry", [make.drive(soils=(lacking,))]), **STATED)


def test_what_the_parameters_leave_out_is_noted(view):
    values = dict(zip(PARAMETERS, (500.0, 0.5, 0.02, 6e5, 1.0), strict=True))
    physics = AugmentedSimulator(
        {name: Estimate(value, 0.1 * value) for name, value in values.items()},
        (StoredEffect("slip_sinkage", "", {"n1": Estimate(0.2, 0.02)}),),
    )
    known = dataclasses.replace(view, physics=MappingProxyType({"sand": physics}))
    assert scm_page(known, **STATED)["notes"] == {
        "sand": ["known beyond the textbook, and not in these parameters: slip_sinkage"]
    }


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"wheel_width_m": None}, "wheel width: not stated .expected the width of the wheels that measured the soil"),
        ({"elastic_stiffness_Pa_m": None}, "elastic stiffness: not stated"),
        ({"damping_Pa_s_m": None}, "damping: not stated"),
        ({"wheel_width_m": 0.0}, "wheel width: 0.0 .expected a finite, positive number"),
        ({"damping_Pa_s_m": -1.0}, "damping: -1.0 .expected a finite, not negative number"),
        ({"elastic_stiffness_Pa_m": 1e6}, r"elastic stiffness: 1e\+06 .expected at least Bekker_Kphi of class clay"),
        ({"resolution": 0.5}, "resolution: means nothing to scm"),
    ],
)
def test_what_is_not_known_is_refused(view, tmp_path, changed, said):
    with pytest.raises(InputError, match=said):
        export(Request(view, **{**STATED, **changed}), tmp_path / "soils.json")
    assert not list(tmp_path.iterdir())
