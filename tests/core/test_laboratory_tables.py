"""Tables as laboratories and programs write them: what is read of them, what is said of it, and what is refused."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from bevameter import read_recording
from bevameter.framework.core.errors import InputError, InputErrors
from bevameter.framework.core.recording.column_map import load_column_map
from bevameter.framework.core.recording.column_names import meaning
from bevameter.framework.core.recording.wheel_file import derive, read_wheel, read_wheel_file
from bevameter.framework.core.vehicle import Wheel

ROOT = Path(__file__).parents[2]


@pytest.fixture
def write(tmp_path):
    def write_file(content, name="lab.csv"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write_file


@pytest.mark.parametrize(
    ("name", "channel", "si"),
    [
        ("Fz [N]", "load_N", 1.0), ("Normal load (kN)", "load_N", 1e3), ("W", "load_N", 1.0), ("w [N]", "load_N", 1.0),
        ("Vertical force", "load_N", 1.0), ("Normal load, W (N)", "load_N", 1.0), ("Radlast [kg]", "load_N", 9.80665),
        ("Charge verticale (daN)", "load_N", 10.0), ("load_n", "load_N", 1.0), ("load std [kN]", "load_sd_N", 1e3),
        ("DP [N]", "drawbar_pull_N", 1.0), ("Drawbar pull (DP) [lbf]", "drawbar_pull_N", 4.4482216152605),
        ("Drawbar pull DP [N]", "drawbar_pull_N", 1.0), ("Radlast Fz (N)", "load_N", 1.0),
        ("DP/W", "drawbar_pull_N", 1.0), ("P / W [%]", "drawbar_pull_N", 1e-2), ("M/(W·r)", "torque_Nm", 1.0),
        ("Drawbar coefficient", "drawbar_pull_N", 1.0), ("Fx/Fz (-)", "drawbar_pull_N", 1.0),
        ("DBP", "drawbar_pull_N", 1.0), ("drawbarPull", "drawbar_pull_N", 1.0), ("Zugkraft / N", "drawbar_pull_N", 1.0),
        ("T [Nm]", "torque_Nm", 1.0), ("Torque Nm", "torque_Nm", 1.0), ("T_w [N·mm]", "torque_Nm", 1e-3),
        ("Torque (ft-lb)", "torque_Nm", 1.3558179483314003), ("wheelTorque_kNm", "torque_Nm", 1e3),
        ("Sinkage/cm", "sinkage_m", 1e-2), ("z_mm", "sinkage_m", 1e-3), ("Einsinkung in mm", "sinkage_m", 1e-3),
        ("Slip ratio s (-)", "slip", 1.0), ("slip_pct", "slip", 1e-2), ("i (%)", "slip", 1e-2), ("s [-]", "slip", 1.0),
        ("omega rad/s", "wheel_speed_rad_s", 1.0), ("ω (deg/s)", "wheel_speed_rad_s", np.pi / 180),
        ("rpm", "wheel_speed_rad_s", np.pi / 30), ("Wheel speed [U/min]", "wheel_speed_rad_s", np.pi / 30),
        ("V [mm/s]", "travel_speed_m_s", 1e-3), ("Carriage speed (km/h)", "travel_speed_m_s", 1 / 3.6),
        ("Time [ms]", "time_s", 1e-3), ("__time", "time_s", 1.0), ("t [µs]", "time_s", 1e-6), ("Test No.", "run", 1.0),
        ("/wheel/fl/load_N", "load_N", 1.0), ("/ft/wrench/force/z", "load_N", 1.0), ("Pass #", "pass", 1.0),
    ],
)  # fmt: skip
def test_names_and_units(name, channel, si):
    found = meaning(name)
    assert (found.channel, found.factor) == (channel, pytest.approx(si))


@pytest.mark.parametrize(
    "name",
    ["T [°C]", "side_force_N", "Slip velocity [m/s]", "width", "V [V]", "w", "n", "Force [N]",
     "current_A", "Wheel speed [m/s]", "load [mn]", "Load [V]", "velL", "ax", "slip_target"],
)  # fmt: skip
def test_names_that_say_something_else_or_not_enough_are_no_channel_in_si(name):
    found = meaning(name)
    assert found is None or found.factor is None


ISSUE = "Fz [N], DP [N], T [Nm], Slip [%], Sinkage [mm]\n100,10,5,10,12.5\n101,20,6,20,13.5\n102,25,7,40,15\n"
PLAIN = {"time_s": [0.0, 0.1], "load_N": [1234.5, 1240.0], "slip": [0.105, 0.115]}
LAYOUTS = {
    "german": "Zeit [s];Radlast [N];Schlupf [%]\r\n0,0;1.234,5;10,5\r\n0,1;1.240;11,5\r\n",
    "latin-1, with lines about the test": "Datum;12.03.2024\r\nPrüfer;Müller\r\n\r\nZeit [s];Radlast [N];Schlupf [%];"
    "\r\n0,0;1234,5;10,5;\r\n0,1;1240;11,5;\r\n".encode("latin-1"),
    "french, blanks between thousands": "Temps (s);Charge (N);Glissement (%)\n"
    "0,0;1\u202f234,5;10,5\n0,1;1\u00a0240;11,5\n",
    "american": 'Time (s),"Load, W (N)",Slip\n0.0,"1,234.5",10.5%\n0.1,"1,240",11.5%\n',
    "utf-16, tabs": "Time [ms]\tNormal load (kN)\tSlip ratio\n0\t1.2345\t0.105\n100\t1.24\t0.115\n".encode("utf-16"),
    "row of units": "time,load,slip\n[s],[kN],[%]\n0.0,1.2345,10.5\n\n0.1,1.24,11.5\n\n",
    "matlab": "% test 5\n% t [s], W [N], i [%]\n0, 1234.5, 10.5\n0.1, 1240, 11.5\n",
    "numpy.savetxt": "# t[s] Fz[N] slip[-]\n0.0 1234.5 0.105\n0.1 1240 0.115\n",
    "labview": "LabVIEW Measurement\nSeparator\tTab\n***End_of_Header***\n\nX_Value\tLoad (N)\tSlip (%)\tComment\n"
    "0\t1234.5\t10.5\n0.1\t1240\t11.5\n",
    "names one below the other": "Zeit;s;0,0;0,1\nRadlast;kN;1,2345;1,240\nSchlupf;%;10,5;11,5\n",
    "the same in commas, a remark before": '# test 5\n"t [s]",0,0.1\n"Load, W [N]",1234.5,1240\nslip,0.105,0.115\n',
    "excel's sep=": "sep=;\nTime [s];Fz [N];Slip [-]\n0;1234,5;0,105\n0,1;1240;0,115\n",
    "repeated header, remarks, empty rows": "Time [s],Fz [N],Slip [-]\n0,1234.5,0.105\nTime [s],Fz [N],Slip [-]\n,,\n"
    "# paused\n0.1,1240,0.115\n",
    "index of pandas": ",time_s,Fz [N],Slip [%]\n0,0.0,1234.5,10.5\n1,0.1,1240,11.5\n",
    "times of day": "Time,Fz [N],Slip [%]\n10:00:00.0,1234.5,10.5\n10:00:00.1,1240,11.5\n",
    "dates": "Timestamp,Fz [N],Slip [%]\n2024-05-01 10:00:00.0,1234.5,10.5\n2024-05-01 10:00:00.1,1240,11.5\n",
    "header of two lines": '"Time\n[s]","Load\n[N]",Slip [%]\n0.0,1234.5,10.5\n0.1,1240,11.5\n',
}  # fmt: skip


@pytest.mark.parametrize("layout", LAYOUTS)
def test_layouts_and_locales(layout, write):
    table, _, notes = read_wheel(write(LAYOUTS[layout]))
    assert set(table.columns) == set(PLAIN)
    for name, values in PLAIN.items():
        np.testing.assert_allclose(table[name], values, rtol=1e-12, err_msg=name)
    assert any("columns read as" in note for note in notes)


def test_the_table_of_a_laboratory_and_what_is_said_of_it(write):
    table, problems, (read, defined, assumed) = read_wheel(write(ISSUE))
    np.testing.assert_array_equal(table["sinkage_m"], [0.0125, 0.0135, 0.015])
    np.testing.assert_array_equal(table["slip"], [0.1, 0.2, 0.4])
    assert table.run.tolist() == ["2", "3", "4"]
    assert read.endswith("slip = Slip [%] / 100; sinkage_m = Sinkage [mm] / 1000")
    assert assumed.endswith("each row is a steady-state trial, for there is neither time nor run")
    assert problems == ()
    assert read_recording(write(ISSUE)).notes == (read, defined, assumed)
    with pytest.warns(UserWarning, match="lab.csv: ") as warned:
        read_wheel_file(write(ISSUE))
    assert [str(each.message) for each in warned] == [read, defined, assumed]


def test_rows_are_counted_as_in_the_file(write):
    with pytest.raises(InputError, match=r"row 7, column Fz \[N\]: 'x' .expected a number"):
        read_wheel(write("Test 5\n\nTime [s],Fz [N]\n0,1\n# remark\n\n1,x\n"))


TRIALS = "Test,Fz [N],DP [N],Slip [%]\n1,100,10,5\n2,110,25,20\n3,150,40,40\n4,160,35,60\n"


@pytest.mark.parametrize(
    "footer",
    ["Mean,130,27.5,31.25\nSD,29.4,13.2,24\nmin,100,10,5\nMaximum,160,40,60\n",
     "\n,130,27.5,31.3\n", "\n,520,110,125\n,1,2,3\n", "Mittelwert (n = 4):,130,27.5,31.25\n",
     ",Summe,110,125\n", "5,130,27.5,std dev\n"],
)  # fmt: skip
def test_rows_of_means_sums_and_scatter_are_no_trials(footer, write):
    table, _, notes = read_wheel(write(TRIALS + footer))
    assert table["load_N"].tolist() == [100, 110, 150, 160]
    first = 6 + footer.startswith("\n")
    assert f"rows of means, sums, extremes or remarks left out: {first}" in notes[0]
    kept, _, notes = read_wheel(write(TRIALS + "5,131,27,40\n6,130,20,32\nmaximal,170,50,70\n"))
    assert len(kept) == 7
    assert not any("left out" in note for note in notes)


def test_means_below_each_block_of_trials_are_none(write):
    block = ",120,25,21.67\n,26.5,15,20.2\n"
    table, _, notes = read_wheel(write(TRIALS.replace("4,160", f"{block}4,160") + "5,170,30,80\n6,190,20,90\n"))
    assert table["load_N"].tolist() == [100, 110, 150, 160, 170, 190]
    assert "remarks left out: 5, 6" in notes[0]
    # A trial without its number is one, and so is a dropout of a sensor.
    trials = TRIALS.replace("Test", "No").replace("4,160", "5,,25,21\n,121,31,22\n4,160")
    table = read_wheel(write(trials)).table
    assert len(table) == 6


def test_headings_between_blocks_are_refused_and_soils_are_filled_down(write):
    blocks = TRIALS.replace("1,100", "Soil: sand,,,\n1,100").replace("4,160", "Soil: loam,,,\n4,160")
    with pytest.raises(InputError, match=r"row 6: 'Soil: loam' heads a block .expected a column that names"):
        read_wheel(write(blocks))
    table, _, notes = read_wheel(write(TRIALS.replace("1,100", "Wet sand,,,\n1,100") + "tested by hand,,,\n"))
    assert len(table) == 4
    assert "remarks left out: 2, 7" in notes[0]
    filled = "Soil,Fz [N],Slip [%]\nsand,1,2\n,3,4\n,5,6\nloam,1,2\n,3,4\n,5,6\n"
    assert read_wheel(write(filled)).table.soil.tolist() == ["sand"] * 3 + ["loam"] * 3


def test_a_diameter_is_two_radii(write):
    table = read_wheel(write("Fz [N],Slip [%],Wheel diameter (mm)\n100,10,300\n")).table
    assert table["radius_m"].tolist() == pytest.approx([0.15])


def test_points_that_may_stand_between_thousands_are_refused(write):
    with pytest.raises(InputError, match=r"'1.252' .expected 1252 or 1.252: decimal = "):
        read_wheel(write("Fz [N];Slip [%]\n802;10\n1.252;20\n"))
    assert read_wheel(write("Fz [N];T [Nm];Slip [%]\n802;1.252;10\n900;1.5;20\n")).table["torque_Nm"][0] == 1.252


def test_coefficients_of_pull_and_torque_are_shares_of_the_load(write, tmp_path):
    path = write("W (N),Torque coefficient T/(W r),DP/W [%],Slip [%]\n100,0.2,5,10\n200,0.3,-10,20\n")
    table, _, notes = read_wheel(path)
    assert table["drawbar_pull_N"].tolist() == pytest.approx([5, -20])
    assert "torque_Nm = Torque coefficient T/(W r) * W r; drawbar_pull_N = DP/W [%] / 100 * W" in notes[0]
    wheel = Wheel(radius_m=0.5, width_m=0.1)
    derived = derive(table, wheel)
    assert derived["torque_Nm"].tolist() == pytest.approx([10, 30])
    (tmp_path / "map.toml").write_text('[columns]\ntorque_Nm = { column = "mu", unit = "W r" }\n')
    mapped = read_wheel(write("Fz [N],mu,Slip [%]\n100,0.2,10\n"), tmp_path / "map.toml").table
    assert derive(mapped, wheel)["torque_Nm"].tolist() == pytest.approx([10])
    own = read_wheel(write("Fz [N],M/(W r),Slip [%],Wheel radius [mm]\n100,0.2,10,250\n")).table
    assert own["torque_Nm"].tolist() == pytest.approx([5])
    with pytest.raises(InputError, match=r"a share of the load .expected a column load_N"):
        read_wheel(write("DP/W,Slip [%],Sinkage [mm]\n0.2,10,5\n"))


@pytest.mark.parametrize("name", ["h/W", "Sinkage z/W", "Torque/W", "T/(W k)"])
def test_other_quotients_are_no_coefficients(name):
    assert meaning(name) is None


def test_of_means_and_deviations_of_repeats_the_means_are_trials(write):
    rows = "".join(f"mean,{100 + 10 * i},{10 * i},{5 * i}\nstd,5,1,2\n" for i in range(1, 5))
    table = read_wheel(write("Statistic,Fz [N],DP [N],Slip [%]\n" + rows)).table
    assert table["load_N"].tolist() == [110, 120, 130, 140]


def test_the_cell_that_differs_is_blamed_and_not_the_others(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["Fz [N]", "DP [N]", "Slip [%]"])
    for row in range(6):
        book.active.append([100.0 + row, 10.0 + row * row, 0.05 + 0.1 * row])
        if row < 5:
            book.active.cell(row + 2, 3).number_format = "0.0%"
    book.save(tmp_path / "lab.xlsx")
    with pytest.raises(InputError, match=r"row 7, column Slip \[%\]: '0.55' .*per cent sign, as in the other rows"):
        read_wheel(tmp_path / "lab.xlsx")
    book.active["A7"] = "Mean"
    book.save(tmp_path / "lab.xlsx")
    np.testing.assert_allclose(read_wheel(tmp_path / "lab.xlsx").table["slip"], [0.05, 0.15, 0.25, 0.35, 0.45])


def test_marks_of_missing_values_are_counted(write):
    table, _, notes = read_wheel(write("Time [s];Fz [N];Slip [%]\n0;10;-\n1;#N/A;6\n2;11;7\n"))
    np.testing.assert_array_equal(table["load_N"], [10, np.nan, 11])
    assert "1 cell such as '#N/A' taken for no value" in notes[0]


def test_deviations_and_footnotes_in_cells_are_left_out_and_counted(write):
    found, _, notes = read_wheel(write("run;Fz [N];Slip [%]\n1;80,25 ± 0,5;10*\n2;1.100 ±0,5;20\n3;120+/-0,5;30†\n"))
    np.testing.assert_allclose(found["load_N"], [80.25, 1100.0, 120.0])
    np.testing.assert_allclose(found["slip"], [0.1, 0.2, 0.3])
    said = "; ".join(notes)
    assert "Fz [N]: the deviations after ± in 3 cells left out" in said
    assert "Slip [%]: marks of footnotes in 2 cells left out" in said
    with pytest.raises(InputError, match=r"'±'"):
        read_wheel_file(write("run,Fz [N],Slip [%]\n1,±,10\n2,100,20\n3,120,30\n"))


def test_signs_are_turned_only_where_that_is_said(write):
    text = "Time [s],Fz [N],T [Nm],Slip [%],z [mm]\n" + "".join(f"{i},-100,-{i + 5},20,-{i + 12}\n" for i in range(5))
    table, _, notes = read_wheel(write(text))
    assert table["load_N"][0] == 100.0
    assert table["torque_Nm"][0] == 5.0
    assert table["sinkage_m"][0] == 0.012
    assert sum("is turned" in note for note in notes) == 3
    own = "time_s,load_N,slip\n" + "".join(f"{i},-100,0.2\n" for i in range(5))
    assert read_wheel(write(own)).table["load_N"][0] == -100.0


def test_slip_without_a_unit_is_judged_by_its_size_or_refused(write):
    def slip(values):
        rows = "".join(f"{i},100,{value}\n" for i, value in enumerate(values))
        return read_wheel(write("Time [s],Fz [N],Slip\n" + rows))

    assert "a fraction, not per cent" in slip([0.1, 0.5]).notes[1]
    assert slip([5, 40]).table["slip"].tolist() == [0.05, 0.4]
    with pytest.raises(InputError, match=r"column Slip: no unit, and values up to 8 .*Slip \[%\]"):
        slip([2, 8])
    with pytest.raises(InputError, match="column Slip: counts the rows"):
        slip(range(1, 40))


def test_all_faults_come_at_once_each_with_its_mend(write):
    path = write("Fz [foo],DP [N],Torqe [Nm],Slip,Sinkage,Sample\n1,2,3,5,12.5,0.1\n1,x,3,6,13,0.2\n")
    with pytest.raises(InputErrors) as error:
        read_wheel(path)
    first, *lines = str(error.value).splitlines()
    assert first == f"{path}: {len(lines) - 1} faults, and 1 in doubt"
    assert 'column Sample: not known by its name (expected nothing, or CHANNEL = { column = "Sample", unit' in lines[-1]
    for said in (
        "column Torqe [Nm]: no column of a wheel file (expected torque_Nm)",
        "column Fz [foo]: unit 'foo' (expected load_N",
        "row 3, column DP [N]: 'x' (expected a number)", "column Slip: no unit", "such as Sinkage [mm]",
    ):  # fmt: skip
        assert any(said in line for line in lines), said


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("Time [s],Normal load [N],Fz [N]\n0,1,2\n1,2,3\n", "2 columns mean load_N: Normal load .N., Fz .N."),
        ("Time [s],Fz [N],Fz [N]\n0,1,2\n1,2,3\n", "2 columns mean load_N"),
        ("Time [s];Nomal load [N]\n0;1\n", r"column Nomal load \[N\]: .*did you mean normal load"),
        ("Time [s];Fz [N]\n0;1,234\n1;1,300\n", "'1,234' and 1 more rows .expected 1.234 or 1234: decimal = "),
        ("Time [s];Slip [%];Fz [N]\n0,5;1;100.25\n1,5;2;100.5\n", "'0,5'.* one decimal mark: there is '100.25'"),
        ("Time [s],Drehzahl,Fz [N]\n0,1,2\n", "column Drehzahl: no unit .expected wheel_speed_rad_s: one of rad/s"),
        ("Clock,Fz [N]\n0.1,1\n0.2,1\n0.3,1\n0.5,1\n", "neither column time_s nor column run; there are Clock"),
        ("Fz [N]\n" + "1\n" * 501, "neither column time_s"),
        ("0,100,5\n1,100,6\n", "no header: '0,100,5'"),
        ("Time [s],load_N\nms,kN\n0,1\n", "column load_N: the row of units says kN"),
        ("Time,Fz [N]\n1700000000000,1\n1700000000010,1\n", r"column Time: no unit.*such as Time \[ns\]"),
        ("[" * 9000 + "\n1\n", "a name of 9000 characters"),
        ("hello world\nthis is a text\n", "neither column time_s"),
        (b"\x7fELF\x00\x01", "binary data"),
        ("Time [s],Fz [N]\n0,1,2\n1,2,3\n2,3,4\n", "row 2: 3 cells .expected 2, as in the header; 2 more rows differ"),
    ],
)
def test_what_is_in_doubt_or_no_table_is_refused(content, says, write):
    with pytest.raises(InputError, match=says):
        read_wheel(write(content))


def test_columns_near_to_a_channel_have_a_hint(write):
    _, problems, _ = read_wheel(write("Time [s],Fz [N],rut_depth_m\n0,1,0.3\n1,2,0.3\n"))
    assert any(
        "rut_depth_m: not used; expected sinkage_m, of the wheel's lowest point" in problem for problem in problems
    )


def test_a_table_in_si_takes_no_letter_for_a_channel(write):
    table, problems, notes = read_wheel(write("time_s,load_N,slip,T\n0,1,0.1,20\n1,1,0.1,20\n"))
    assert "torque_Nm" not in table
    assert "columns not used: T" in problems[0]
    assert notes == ()


def test_a_column_map(write):
    table = write("Zeit;oben;M;s\n0;1,5;-3;12\n1;1,6;-4;14\n")
    text = """decimal = ","
[columns]
time_s = { column = "Zeit", unit = "ms" }
load_N = { column = "oben", unit = "kN", offset = 10.0 }
torque_Nm = { column = "M", scale = -1.0 }
slip = { column = "s", unit = "%" }
"""
    read = read_recording(table, topics=write(text, "map.toml")).wheel
    assert {name: values.tolist() for name, values in read.columns.items()} == {
        "time_s": [0.0, 0.001], "load_N": [1510.0, 1610.0], "torque_Nm": [3.0, 4.0], "slip": [0.12, 0.14],
    }  # fmt: skip
    for wrong, says in (
        ('load_N = "obem"', r"key columns.load_N: no column 'obem' in lab.csv .expected oben"),
        ('load_kN = "oben"', "load_kN: no column of a wheel file"),
        ('load_N = { column = "oben", unit = "V" }', "unit 'V' .expected one of N, kN"),
        ('load_N = { column = "oben", factor = 2 }', "no such key"),
    ):
        with pytest.raises(InputError, match=says):
            read_wheel(table, write(f"[columns]\n{wrong}\n", "map.toml"))


def test_the_column_map_of_the_documentation_is_read(write):
    page = (ROOT / "docs" / "recording.md").read_text(encoding="utf-8")
    section = page.split("## Laboratory tables")[1].split("\n## ")[0]
    example, _, wide = section[section.index("    decimal = ") :].partition("Where each wheel has columns of its own")
    mapped, of_wheels = (
        load_column_map(write("\n".join(line[4:] for line in text.splitlines() if line.startswith("    ")), "map.toml"))
        for text in (example, wide)
    )
    assert set(mapped.columns) == {"load_N", "torque_Nm", "slip"}
    assert (mapped.decimal, mapped.sheet) == (",", "Versuch 3")
    assert set(of_wheels.of_wheel("front_left").columns) == {
        "time_s", "travel_speed_m_s", "wheel_speed_rad_s", "torque_Nm"
    }  # fmt: skip


@pytest.fixture
def workbook(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")

    def save(sheets):
        book = openpyxl.Workbook()
        book.remove(book.active)
        for title, rows in sheets.items():
            sheet = book.create_sheet(title)
            for row in rows:
                sheet.append(row)
        book.save(tmp_path / "lab.xlsx")
        return tmp_path / "lab.xlsx"

    return save


DATA = [["Test 5"], [], ["Time [s]", "Fz [kN]", "Slip [%]", "Remark"], [0.0, 0.1, 10, "a, b"], [0.1, 1 / 3, 20, None]]


def test_a_workbook(workbook, write):
    table, _, notes = read_wheel(workbook({"Info": [["Operator", "A"]], "Data": DATA}))
    np.testing.assert_array_equal(table["load_N"], [100.0, 1000.0 * (1 / 3)])
    assert notes[0] == "lab.xlsx: sheet 'Data', header in row 3"
    both = workbook({"one": DATA, "two": DATA})
    with pytest.raises(InputError, match=r"2 sheets could be the table: one, two .expected sheet = "):
        read_wheel(both)
    assert len(read_wheel(both, write('sheet = "two"', "map.toml")).table) == 2
    with pytest.raises(InputError, match=r"no sheet 'three' .expected one of one, two"):
        read_wheel(both, write('sheet = "three"', "map.toml"))


def test_per_cent_shown_by_excel_alone(workbook):
    import openpyxl

    path = workbook({"Data": DATA})
    book = openpyxl.load_workbook(path)
    for row, value in ((4, 0.1), (5, 0.2)):
        book["Data"].cell(row, 3, value).number_format = "0.0%"
    book.save(path)
    np.testing.assert_allclose(read_wheel(path).table["slip"], [0.1, 0.2])


def test_hostile_workbooks(workbook, tmp_path):
    bomb = tmp_path / "bomb.xlsx"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/worksheets/sheet1.xml", b"0" * (257 * 2**20))
    with pytest.raises(InputError, match="unpacks to 269484032 bytes"):
        read_wheel(bomb)
    bomb.write_bytes(b"no archive")
    with pytest.raises(InputError, match="no readable workbook"):
        read_wheel(bomb)
    whole = workbook({"Data": DATA}).read_bytes()
    bomb.write_bytes(whole[:-100])
    with pytest.raises(InputError, match="no readable workbook"):
        read_wheel(bomb)


def test_slip_in_per_cent_that_looks_like_a_fraction_is_said(tmp_path):
    path = tmp_path / "lab.csv"
    path.write_text("Fz [N],T [Nm],Slip [%]\n100,5,0.05\n100,9,0.2\n100,12,0.6\n")
    _, _, notes = read_wheel(path)
    assert any("Slip [%] is in per cent, though it never exceeds 1" in note for note in notes)
