import json
import sys

import pytest
from bevameter import TerrainDatabase
from bevameter.database.exporters import EXPORTERS, load_exporters
from bevameter.database.grid import LAYERS
from bevameter.framework.cli.main import main
from bevameter.framework.core.recording.bag_files import BagFile
from bevameter.framework.core.recording.bag_messages import decode
from PIL import Image
from small_site import some_drive


@pytest.fixture
def export(tmp_path, monkeypatch, capsys):
    """Run `bevameter db export ...` on a small database; give exit status, stdout, stderr."""
    monkeypatch.chdir(tmp_path)
    with TerrainDatabase("terrain.db") as database:
        database.add_drive(some_drive())

    def run(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["bevameter", "db", "export", *arguments])
        with pytest.raises(SystemExit) as leaving:
            main()
        said = capsys.readouterr()
        return int(leaving.value.code or 0), said.out, said.err

    return run


def test_a_costmap(export, tmp_path):
    arguments = ("--required-strength", "2 kPa", "--bounds", "-0.5", "0", "1", "0.5", "--resolution", "50 cm")
    said = export("terrain.db", "costs.yaml", *arguments, "--normal-stress", "10 kPa")
    assert said == (0, "written to costs.yaml and costs.pgm\n", "")
    with TerrainDatabase("terrain.db") as database:
        lower = database.snapshot().at(0.1, 0.1, normal_stress=1e4).shear_strength_lower[0]
    with Image.open(tmp_path / "costs.pgm") as image:
        assert list(image.tobytes()) == [255, int(98 * 2e3 / lower), 255]


def test_layers_of_a_grid_map(export, tmp_path):
    assert export("terrain.db", "map.mcap", "--layer", "cohesion", "--layer", "known")[0] == 0
    (message,) = BagFile(tmp_path / "map.mcap").messages()
    decoded = decode(message)
    assert decoded.layers == ["cohesion", "known"]
    assert (decoded.info.length_x, decoded.info.length_y, decoded.info.resolution) == (4.5, 2.5, 0.5)
    assert export("terrain.db", "bag", "--as", "gridmap")[0] == 0
    (message,) = BagFile(tmp_path / "bag").messages()
    assert tuple(decode(message).layers) == LAYERS


def test_soils_for_chrono(export, tmp_path):
    stated = ("--wheel-width", "12 cm", "--elastic-stiffness", "4e7 Pa/m", "--damping", "30 kPa*s/m")
    assert export("terrain.db", "soils.json", *stated)[0] == 0
    sand = json.loads((tmp_path / "soils.json").read_text())["classes"]["sand"]
    assert sand["Bekker_Kphi"] == pytest.approx(5e5 / 0.12)
    assert (sand["elastic_K"], sand["damping_R"]) == (4e7, 3e4)


@pytest.mark.parametrize("name", ["ground.tif", "ground.gpkg"])
def test_maps_on_earth(export, tmp_path, name):
    pytest.importorskip("rasterio" if name.endswith("tif") else "pyogrio", reason="the extra geo is not installed")
    assert export("terrain.db", name, "--origin", "-47.1", "15.4", "--heading", "-30") == (
        0,
        f"written to {name}\n",
        "",
    )
    assert (tmp_path / name).stat().st_size > 1000


def test_the_help_names_every_format_and_ending(export):
    _, out, _ = export("--help")
    load_exporters()
    for exporter in EXPORTERS:
        assert exporter.name in out
        assert all(ending in out for ending in exporter.endings[:1])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("none.db", "a.yaml"), "none.db"),
        (("terrain.db", "a.yaml"), "required strength: not stated (expected the shear strength"),
        (("terrain.db", "a.yaml", "--required-strength", "8 kg"), "--required-strength: '8 kg' (expected a pressure"),
        (("terrain.db", "a.xyz"), "a.xyz: a file of kind '.xyz'"),
        (("terrain.db", "a.yaml", "--as", "kml"), "format: 'kml' (expected"),
        (("terrain.db", "a.mcap", "--layer", "colour"), "layers: 'colour' (expected names among class_index"),
        (("terrain.db", "a.mcap", "--bounds", "0", "0", "x", "1"), "--bounds: 'x' (expected a finite number [m])"),
        (("terrain.db", "a.mcap", "--bounds", "1", "0", "0", "1"), "bounds: (1.0, 0.0, 0.0, 1.0)"),
        (("terrain.db", "a.mcap", "--resolution", "-1"), "--resolution: '-1'"),
        (("terrain.db", "a.mcap", "--resolution", "1e-9"), "grid: "),
        (("terrain.db", "a.mcap", "--confidence", "2"), "confidence: 2.0"),
        (("terrain.db", "a.mcap", "--origin", "0", "0"), "origin: means nothing to gridmap"),
        (("terrain.db", "a.mcap", "--site", "moon"), "moon"),
        (("terrain.db", "a.tif"), "origin: not stated"),
        (("terrain.db", "a.tif", "--heading", "3"), "--heading: stated without --origin"),
        (("terrain.db", "a.tif", "--origin", "91", "0"), "latitude: 91.0"),
        (("terrain.db", "a.json"), "wheel width: not stated"),
        (("terrain.db", "terrain.db", "--as", "gridmap"), "would be written over"),
    ],
)
def test_bad_input_is_one_line(export, tmp_path, arguments, said):
    status, out, err = export(*arguments)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert said in err
    assert [path.name for path in tmp_path.iterdir()] == ["terrain.db"]
