"""Tables with columns for each of several wheels: recognised by labels in their names."""

import numpy as np
import pandas as pd
import pytest
from bevameter import inspect_recording, read_recording
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.wheel_file import derive_all, read_wheel
from bevameter.framework.core.recording.wheel_labels import wheels_in
from bevameter.framework.core.vehicle import Vehicle, Wheel

FOUR = ("front_left", "front_right", "rear_left", "rear_right")
STYLES = {
    "Fz FL [N]": ("FL", "FR", "RL", "RR"), "fl_Fz [N]": ("fl", "fr", "rl", "rr"),
    "Fz rear right (N)": ("front left", "front right", "rear left", "rear right"),
    "left_Fz [N]": FOUR, "FzFL_N": ("FL", "FR", "RL", "RR"), "Radlast VL [N]": ("VL", "VR", "HL", "HR"),
    "Fz (FL) [N]": ("FL", "FR", "RL", "RR"),
}  # fmt: skip


def _named(style, label):
    if style.startswith(("fl_", "left_")):
        return [f"{label}_Fz [N]", f"{label}_Slip [%]"]
    if style == "FzFL_N":
        return [f"Fz{label}_N", f"Slip{label}_pct"]
    form = {"Fz FL [N]": "{} {} [{}]", "Fz rear right (N)": "{} {} ({})", "Radlast VL [N]": "{} {} [{}]",
            "Fz (FL) [N]": "{} ({}) [{}]"}[style]  # fmt: skip
    return [form.format("Radlast" if "Rad" in style else "Fz", label, "N"), form.format("Slip", label, "%")]


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("timed", [True, False])
def test_labels_before_and_behind(style, timed, tmp_path):
    columns = {"Time [s]": np.arange(5) / 10.0} if timed else {}
    for wheel, label in enumerate(STYLES[style]):
        load, slip = _named(style, label)
        columns |= {load: 100.0 * wheel + np.arange(5.0), slip: 20.0 + wheel + np.arange(5.0)}
    path = tmp_path / "lab.csv"
    pd.DataFrame(columns).to_csv(path, index=False)
    table = read_wheel(path).table
    assert sorted(set(table.wheel)) == sorted(FOUR)
    for number, wheel in enumerate(FOUR):
        rows = table.select(table.wheel == wheel)
        np.testing.assert_allclose(rows["load_N"], 100.0 * number + np.arange(5.0))
        np.testing.assert_allclose(rows["slip"], (20.0 + number + np.arange(5.0)) / 100.0)
    assert (table.run is None) == timed


def test_numbered_wheels_have_two_channels_in_common(tmp_path):
    def found(*names):
        return wheels_in(names, [None] * len(names), frozenset())

    assert set(found("Fz_1", "DP_1", "Fz_2", "DP_2")) == {"wheel_1", "wheel_2"}
    assert found("Load 1 [N]", "Load 2 [N]", "Slip [%]") == {}
    assert found("Fz [N]", "Slip left [%]") == {}
    (tmp_path / "lab.csv").write_text("Fz FL [N],FL Fz [N],Fz FR [N]\n1,2,3\n")
    with pytest.raises(InputError, match=r"2 columns mean load_N of front_left: Fz FL \[N\], FL Fz \[N\]"):
        read_wheel(tmp_path / "lab.csv")


def test_wheels_have_the_vehicles_names_and_the_map_that_is_written_reads_the_same(tmp_path):
    path = tmp_path / "lab.csv"
    path.write_text("Time [s],Fz FL [kN],z FL [mm],Fz FR [kN],z FR [mm]\n0,1,20,2,30\n1,1.5,25,2.5,35\n")
    wheels = tuple(
        Wheel(name=name, radius_m=0.2, width_m=0.1, position_m=(0, y)) for name, y in (("lf", 1), ("rf", -1))
    )
    assert set(derive_all(read_wheel(path).table, Vehicle(name="axle", wheels=wheels)).wheel) == {"lf", "rf"}
    files = inspect_recording(path).write(tmp_path / "maps")
    with_map = read_recording(path, topics=next(file for file in files if file.name == "columns.toml")).wheel
    for name, values in read_wheel(path).table.columns.items():
        np.testing.assert_array_equal(with_map[name], values)
