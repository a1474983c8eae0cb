import gzip
import string

import numpy as np
import pandas as pd
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording import tables
from bevameter.framework.core.recording.types import WHEEL_COLUMNS, WheelTable
from bevameter.framework.core.recording.wheel_file import (
    derive,
    derive_all,
    read_wheel,
    read_wheel_file,
    slip_from_speeds,
)
from bevameter.framework.core.vehicle import Vehicle, Wheel, load_vehicle
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st


@pytest.fixture
def wheel_csv(tmp_path):
    def write(content, name="wheel.csv"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "wheel.csv: an empty file"),
        ("time_s,load_N\n", "header without rows"),
        ("load_N,slip\n1,0.1\n", "neither column time_s nor column run"),
        ("time_s,load_rpm\n0,1\n", "column load_rpm: no column of a wheel file .expected load_N"),
        ("time_s,laod_N\n0,1\n", "column laod_N: .* .expected load_N"),
        ("time_s,load_sd_m\n0,1\n", "column load_sd_m: .* .expected load_sd_N"),
        ("time,load_N\n0,1\n", "column time: .* .expected time_s"),
        ("time_s,load_N,load_N\n0,1,2\n", "row 1: column load_N stands twice"),
        ("time_s,,load_N\n0,1,2\n", "row 1: column 2 has no name"),
        ("time_s,load_N\n0,1\n1,abc\n", "row 3, column load_N: 'abc' .expected a number"),
        ("time_s,load_N\n0,1\n1,True\n", "row 3, column load_N: 'True'"),
        ("time_s,load_N\n0,1_0\n", "row 2, column load_N: '1_0'"),
        (
            "time_s,load_N\n0,1\n1,1e300\n",
            "row 3, column load_N: 1e.300 .expected a number between -1e.12 and 1e.12, SI",
        ),
        ("time_s,load_N\n0,1\n1,-inf\n", "row 3, column load_N: -inf .expected a finite number"),
        ("time_s,load_N\n0,1e999\n", "row 2, column load_N: inf"),
        ("time_s,load_N\n,1\n", "row 2, column time_s: no value"),
        ("time_s,load_N\n0,1\n1,2,3\n2\n", "row 3: 3 cells .expected 2"),
        ("time_s,load_N\n0,1\n2,1\n1.5,1\n", "row 4, column time_s: time runs backwards, 2 s in row 3, then 1.5 s"),
        ("time_s,slip\n0,0.5\n1,1.5\n2,-3\n", "row 3, column slip: 1.5 and 1 more rows"),
        ("time_s,load_N,pass\n0,1,1\n1,1,0\n", "row 3, column pass: 0 .expected 1 on fresh ground"),
        ("run,load_N\n,1\n", "row 2, column run: an empty cell"),
        ("time_s\n1\n", "no wheel channel has a value"),
        ("time_s,load_N\n0,\n", "no wheel channel has a value"),
        (b"\x89PNG\r\n\x1a\n\0\0", "binary data"),
        (b"time_s,load_N\n0,\x81\xfe\n", "byte 16 is not UTF-8"),
        ('time_s,load_N\n0,"1\n', "no comma-separated text"),
    ],
)
def test_what_is_wrong_is_named_with_its_place(content, says, wheel_csv):
    with pytest.raises(InputError, match=says):
        read_wheel_file(wheel_csv(content))


def test_a_file_that_is_not_there_or_of_another_kind(tmp_path):
    with pytest.raises(InputError, match=r"none\.csv: no such file"):
        read_wheel_file(tmp_path / "none.csv")
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(InputError, match="a folder"):
        read_wheel_file(tmp_path / "folder.csv")
    (tmp_path / "wheel.log").write_text("x")
    with pytest.raises(InputError, match=r"'\.log'"):
        read_wheel_file(tmp_path / "wheel.log")


def test_time_may_interleave_between_wheels_and_start_again_with_each_run(wheel_csv):
    table = read_wheel_file(
        wheel_csv("time_s,wheel,run,load_N\n0,a,1,1\n0,b,1,2\n1,a,1,3\n1,b,1,4\n0,a,2,5\n0.5,a,2,6\n")
    )
    assert table.wheel.tolist() == ["a", "b", "a", "b", "a", "a"]
    assert table.run.tolist() == ["1", "1", "1", "1", "2", "2"]
    with pytest.raises(InputError, match="row 4, column time_s: time runs backwards, 1 s in row 2"):
        read_wheel_file(wheel_csv("time_s,wheel,load_N\n1,a,1\n0,b,2\n0.5,a,3\n"))


def test_a_stretch_that_was_not_observed_is_nan_and_an_empty_column_is_left_out(wheel_csv):
    table, problems, _ = read_wheel(wheel_csv("time_s,load_N,torque_Nm,slip\n0,1,,0.1\n1,,,nan\n2,NaN,NA,0.2\n"))
    np.testing.assert_array_equal(table["load_N"], [1.0, np.nan, np.nan])
    np.testing.assert_array_equal(table["slip"], [0.1, np.nan, 0.2])
    assert "torque_Nm" not in table
    assert problems == ("wheel.csv, column torque_Nm: no value in any row, left out",)


def test_columns_of_the_users_own_are_kept_where_they_are_numbers(wheel_csv):
    table = read_wheel_file(
        wheel_csv('time_s,load_N,load_sd_N,side_force_N,note,sinkage_sd_m\n0,1,2,3,"a, b",4\n1,1,2,3,,4\n')
    )
    assert set(table.columns) == {"time_s", "load_N", "load_sd_N", "side_force_N", "sinkage_sd_m"}


@pytest.mark.parametrize(
    "name",
    ["wheel_speed_left_rad_s", "travel_speed_x_m_s", "yaw_rad", "roll_rad", "steer_angle_rad", "slip_angle_sd_rad",
     "sinkage_rate_m_s", "side_force_N", "current_A", "radius_m", "slip_target", "load_sd_N"],
)  # fmt: skip
def test_a_column_of_the_users_own_is_no_misspelling(name, wheel_csv):
    table = read_wheel_file(wheel_csv(f"time_s,load_N,{name}\n0,1,2\n"))
    np.testing.assert_array_equal(table[name], [2.0])


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ("DP", "columns not used: DP; there is no torque_Nm, sinkage_m, drawbar_pull_N"),
        ("torque_Nm,pull", "columns not used: pull; there is no sinkage_m, drawbar_pull_N"),
        ("torque_Nm,sinkage_m,drawbar_pull_N,temp_C", "columns not used: temp_C"),
        ("a,b,d,e,f,g,h,q", "columns not used: a, b, d, e, f, g and 2 more; there is no torque_Nm, sinkage_m, drawb"),
    ],
)
def test_columns_that_nothing_reads_are_named(names, said, wheel_csv):
    values = ",".join("1" for _ in names.split(","))
    _, (problem,), _ = read_wheel(wheel_csv(f"time_s,load_N,{names}\n0,1,{values}\n1,2,{values}\n"))
    assert problem.startswith(f"wheel.csv: {said}")


def test_columns_of_numbers_with_their_unit_and_of_remarks_are_named(wheel_csv):
    _, (problem, words), _ = read_wheel(
        wheel_csv("time_s,load_N,DP,remark\n0,1,3.2 N,dry\n1,2,-0.4 N,2 stones\n2,3,,\n")
    )
    assert problem.startswith("wheel.csv: columns not used: DP; ")
    assert words == "wheel.csv: columns of text not used: remark"


def test_columns_that_are_known_or_read_are_not_named(wheel_csv):
    names = (*WHEEL_COLUMNS[1:], "load_sd_N", "drawbar_pull_sd_N", "slip_sd", "radius_m", "width_m", "grouser_count",
             "grouser_height_m", "yaw_rad", "wheel", "run")  # fmt: skip
    values = ",".join("1" for _ in names)
    assert read_wheel(wheel_csv(f"time_s,{','.join(names)}\n0,{values}\n"))[1] == ()


def test_a_last_row_that_was_cut_off_is_left_out_and_reported(wheel_csv):
    table, problems, _ = read_wheel(wheel_csv("time_s,load_N,slip\n0,1,0\n1,2,0\n2,3"))
    assert len(table) == 2
    assert problems == ("wheel.csv, row 4: cut off in mid-row, left out",)


def test_byte_order_marks_and_line_ends_do_not_matter(wheel_csv):
    table = read_wheel_file(wheel_csv("\ufefftime_s, load_N\r\n0, 1\r\n1, 2\r\n\r\n"))
    np.testing.assert_array_equal(table["load_N"], [1.0, 2.0])


def test_slip_a_little_beyond_its_bounds_is_taken_for_noise(wheel_csv):
    np.testing.assert_array_equal(read_wheel_file(wheel_csv("time_s,slip\n0,1.01\n1,-1.005\n"))["slip"], [1.0, -1.0])


def test_parquet_and_gzip_hold_the_same(tmp_path, wheel_csv):
    frame = pd.DataFrame({"time_s": [0.0, 0.1], "load_N": [1.5, np.nan], "pass": [1, 2], "wheel": ["a", "b"]})
    frame.to_parquet(tmp_path / "wheel.parquet")
    text = frame.to_csv(index=False).encode()
    for path in (tmp_path / "wheel.parquet", wheel_csv(gzip.compress(text), "wheel.csv.gz"), wheel_csv(text)):
        table = read_wheel_file(path)
        for name in ("time_s", "load_N", "pass"):
            np.testing.assert_array_equal(table[name], frame[name].to_numpy(dtype=float))
        assert table.wheel.tolist() == ["a", "b"]


@pytest.mark.parametrize(
    "content",
    [b"nonsense", b"\x1f\x8b", gzip.compress(b"time_s,load_N\n0,1\n" * 99, mtime=0)[:-12]],
    ids=["no gzip", "two bytes", "cut off"],  # of bytes, the moment of compression among them, pytest would make names
)
def test_damaged_gzip(content, wheel_csv):
    with pytest.raises(InputError, match="damaged gzip"):
        read_wheel_file(wheel_csv(content, "wheel.csv.gz"))


def test_a_gzip_bomb_is_stopped(wheel_csv, monkeypatch):
    monkeypatch.setattr(tables, "MAX_TABLE_BYTES", 10_000)
    with pytest.raises(InputError, match="unpacks to more than 10000 bytes"):
        read_wheel_file(wheel_csv(gzip.compress(b"time_s,load_N\n" + b"0,1\n" * 50_000), "wheel.csv.gz"))


def test_parquet_faults_are_named(tmp_path):
    path = tmp_path / "wheel.parquet"
    path.write_bytes(b"PAR1 and no more")
    with pytest.raises(InputError, match="no readable Parquet"):
        read_wheel_file(path)
    pd.DataFrame({"time_s": [0.0], "load_N": ["5"]}).to_parquet(path)
    with pytest.raises(InputError, match="column load_N: holds"):
        read_wheel_file(path)
    pd.DataFrame({"time_s": [1.0, 0.5], "load_N": [5.0, 6.0]}).to_parquet(path)
    with pytest.raises(InputError, match="row 2, column time_s: time runs backwards, 1 s in row 1"):
        read_wheel_file(path)


number = st.one_of(st.just(float("nan")), st.floats(-1e12, 1e12, allow_subnormal=True))
name = st.text(string.ascii_letters + string.digits + ' ,"-', min_size=1, max_size=8).filter(str.strip)


@st.composite
def wheel_frames(draw):
    rows = draw(st.integers(1, 8))
    columns = draw(st.lists(st.sampled_from([c for c in WHEEL_COLUMNS if c not in ("time_s", "slip")]), unique=True))
    frame = {"time_s": sorted(draw(st.lists(st.floats(-1e9, 1e9), min_size=rows, max_size=rows)))}
    frame |= {column: draw(st.lists(number, min_size=rows, max_size=rows)) for column in columns}
    if "pass" in frame:
        frame["pass"] = np.maximum(frame["pass"], 1.0)
    frame["slip"] = draw(st.lists(st.floats(-1, 1), min_size=rows, max_size=rows))
    if draw(st.booleans()):
        frame["run"] = draw(st.lists(name, min_size=rows, max_size=rows))
    return pd.DataFrame(frame)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(frame=wheel_frames(), kind=st.sampled_from(["csv", "csv.gz", "parquet"]))
def test_what_was_written_is_read_to_the_last_bit(frame, kind, tmp_path):
    path = tmp_path / f"wheel.{kind}"
    frame.to_parquet(path) if kind == "parquet" else frame.to_csv(path, index=False)
    table = read_wheel_file(path)
    assert len(table) == len(frame)
    for column in frame.columns:
        if column == "run":
            assert table.run.tolist() == [cell.strip() for cell in frame["run"]]
        elif frame[column].isna().all():
            assert column not in table
        else:
            np.testing.assert_array_equal(table[column], frame[column].to_numpy())


def test_slip_by_the_convention_of_the_contract():
    rim = np.array([1.0, 1.0, 0.5, 0.0, 1.0, 0.0, 1e-4, -1.0, -0.5, 1.0])
    travel = np.array([0.8, 1.0, 1.0, 1.0, 0.0, 0.0, 1e-4, -0.8, -1.0, -1.0])
    expected = [0.2, 0.0, -0.5, -1.0, 1.0, np.nan, np.nan, 0.2, -0.5, np.nan]
    np.testing.assert_allclose(slip_from_speeds(rim, travel), expected)


def test_derive_fills_only_what_was_not_recorded(tmp_path):
    wheel = Wheel(radius_m=0.1, width_m=0.1)
    columns = {"wheel_speed_rad_s": np.array([10.0, 10.0]), "travel_speed_m_s": np.array([0.9, 0.5])}
    table = WheelTable({**columns, "slip": np.array([0.3, np.nan])}, None, None, tmp_path)
    np.testing.assert_allclose(derive(table, wheel)["slip"], [0.3, 0.5])
    bare = WheelTable({"wheel_speed_rad_s": columns["wheel_speed_rad_s"]}, None, None, tmp_path)
    assert "slip" not in derive(bare, wheel)


def test_each_wheel_is_derived_with_its_own_radius(tmp_path):
    vehicle = Vehicle(wheels=(Wheel(name="a", radius_m=0.1, width_m=0.1), Wheel(name="b", radius_m=0.2, width_m=0.1)))
    columns = {"wheel_speed_rad_s": np.full(2, 10.0), "travel_speed_m_s": np.full(2, 0.5)}
    table = WheelTable(columns, np.array(["b", "a"], object), None, tmp_path)
    np.testing.assert_allclose(derive_all(table, vehicle)["slip"], [0.75, 0.5])
    with pytest.raises(InputError, match="no column wheel"):
        derive_all(WheelTable(columns, None, None, tmp_path), vehicle)
    with pytest.raises(InputError, match=r"column wheel: 'c' .*one of the vehicle's wheels, a, b"):
        derive_all(WheelTable(columns, np.array(["a", "c"], object), None, tmp_path), vehicle)


def test_one_wheel_without_a_name_is_what_all_are_like(tmp_path):
    columns = {"wheel_speed_rad_s": np.full(2, 10.0), "travel_speed_m_s": np.full(2, 0.5)}
    table = WheelTable(columns, np.array(["left", "right"], object), None, tmp_path)
    alike = Vehicle(wheels=(Wheel(radius_m=0.1, width_m=0.1),))
    np.testing.assert_allclose(derive_all(table, alike)["slip"], [0.5, 0.5])
    left = Vehicle(wheels=(Wheel(name="left", radius_m=0.1, width_m=0.1),))
    with pytest.raises(InputError, match=r"column wheel: 'right' .*one of the vehicle's wheels, left"):
        derive_all(table, left)


@pytest.mark.parametrize(("folder", "n", "tolerance"), [("single-wheel-sand", 189, 2e-3), ("granular-wheel", 28, 1e-6)])
def test_real_wheel_files_and_their_slip(folder, n, tolerance, shared_data):
    table = read_wheel_file(shared_data / folder / "wheel.csv")
    assert len(table) == n
    assert table.run is not None
    assert "time_s" not in table
    wheel = load_vehicle(shared_data / folder / "vehicle.toml").wheel()
    derived = slip_from_speeds(table["wheel_speed_rad_s"] * wheel.radius_m, table["travel_speed_m_s"])
    np.testing.assert_allclose(derived, table["slip"], atol=tolerance)


def test_a_wheel_file_of_many_rows_with_columns_of_text_is_read(shared_data):
    table = read_wheel_file(shared_data / "published-wheel-tests" / "wheel_tests.csv")
    assert "citation" not in table
    assert {"load_N", "slip", "drawbar_pull_N", "sinkage_m", "torque_Nm", "radius_m"} <= set(table.columns)
