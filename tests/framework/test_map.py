"""The picture of the map: it is written, shows the classes where they are, and says when it is synthetic."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import matplotlib.figure
import numpy as np
import pytest
from bevameter.database.observations import Drive, SoilObservation, TerrainObservations
from bevameter.database.store import TerrainDatabase
from bevameter.framework.cli.main import app
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.evidence import ClassEvidence
from bevameter.framework.core.recording.types import Pose, Recording
from bevameter.framework.core.soil import Quantity, ShearStrength, SoilEstimate
from bevameter.framework.map import draw_map
from typer.testing import CliRunner

CLASSES = ("clay", "gravel", "marsh")


def quantity(value, sd):
    return Quantity(value, sd, value - 1.96 * sd, value + 1.96 * sd)


def soil_at(start_s, x_m, name, c_Pa, phi_deg):
    phi = math.radians(phi_deg)
    estimate = SoilEstimate(
        {"c_Pa": quantity(c_Pa, 200.0), "phi_rad": quantity(phi, 0.02)},
        np.array([c_Pa, math.tan(phi)]), np.diag([4e4, 4e-4]), {}, (ShearStrength(1e4, 6e3, 5e3, 7e3),),
        {"c_Pa": True, "phi_rad": True}, "", "ml", ("load_N", "torque_Nm", "slip"), 200, 1.0,
    )  # fmt: skip
    return SoilObservation(start_s, start_s + 10, x_m, 0.0, {name: 0.95}, estimate, (5e3, 2e4), 700.0)


def fill(path, *, site="quarry", models=None):
    columns, rows = np.meshgrid(np.arange(0, 120), np.arange(-6, 6))
    cell_x, cell_y = columns.ravel(), rows.ravel()
    best = np.minimum(cell_x // 40, 2)
    sure = np.where(np.abs(cell_y + 0.5) < 3, 0.97, 0.6)
    p = np.repeat(((1 - sure) / 2)[:, None], 3, axis=1)
    p[np.arange(len(best)), best] = sure
    unknown = (cell_x > 100) & (cell_y > 2)
    p[unknown] = 1 / 3
    evidence = ClassEvidence(
        CLASSES, p, np.where(unknown, 0.0, sure), unknown,
        tuple(("camera: blurred",) if closed else () for closed in unknown),
    )  # fmt: skip
    terrain = TerrainObservations(0.5, cell_x, cell_y, cell_x * 0.5, np.full(len(best), "fused"), evidence)
    soils = (soil_at(0.0, 5.0, "clay", 4000.0, 20.0), soil_at(25.0, 30.0, "gravel", 300.0, 36.0))
    drive = Drive("d" * 64, "drive", site, "rover", None, models or {"camera": "a" * 64}, "test", terrain, soils)
    with TerrainDatabase(path) as database:
        database.add_drive(drive)


def way():
    t = np.linspace(0.0, 60.0, 601)
    return Recording("d", Path("d"), None, None, "", "d" * 64, pose=Pose(t, t, np.zeros_like(t), np.zeros_like(t)))


def test_the_picture_shows_the_classes_where_they_are(tmp_path):
    fill(tmp_path / "t.db")
    with TerrainDatabase(tmp_path / "t.db") as database:
        draw_map(database, tmp_path / "map.png", tracks=[way()])
    picture = cv2.imread(str(tmp_path / "map.png"))
    assert picture.shape[1] == 1800
    # Clay (red) on the left third, gravel (grey-blue) in the middle: BGR means along the picture.
    width = picture.shape[1]
    for place, reddest in ((0.25, True), (0.5, False)):
        column = picture[:, int(place * width)].astype(int)
        coloured = column[np.ptp(column, axis=1) > 15]
        assert len(coloured) > 20
        assert (np.median(coloured[:, 2]) > np.median(coloured[:, 0])) == reddest


@pytest.mark.parametrize(
    ("site", "models", "said"),
    [("synthetic field", None, True), ("quarry", {"camera": "synthetic abc"}, True), ("quarry", None, False)],
)
def test_a_synthetic_map_says_so(tmp_path, monkeypatch, site, models, said):
    fill(tmp_path / "t.db", site=site, models=models)
    texts = []
    write = matplotlib.figure.Figure.savefig

    def spy(figure, *arguments, **options):
        texts.extend(axes.get_title(loc="right") for axes in figure.axes)
        return write(figure, *arguments, **options)

    monkeypatch.setattr(matplotlib.figure.Figure, "savefig", spy)
    with TerrainDatabase(tmp_path / "t.db") as database:
        draw_map(database, tmp_path / "map.svg")
    assert ("synthetic" in texts) == said
    assert (tmp_path / "map.svg").stat().st_size > 1000


def test_what_cannot_be_drawn_is_one_line(tmp_path):
    fill(tmp_path / "t.db")
    with TerrainDatabase(tmp_path / "t.db") as database, pytest.raises(InputError, match="picture format"):
        draw_map(database, tmp_path / "map.doc")
    with TerrainDatabase(tmp_path / "empty.db") as database:
        database.make()
        with pytest.raises(InputError, match="no ground"):
            draw_map(database, tmp_path / "map.png")
    assert not (tmp_path / "map.png").exists()


def test_the_command_draws(tmp_path):
    fill(tmp_path / "t.db")
    result = CliRunner().invoke(app, ["map", "--db", str(tmp_path / "t.db"), "--out", str(tmp_path / "map.png")])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "map.png").exists()
    bad = CliRunner().invoke(app, ["map", "--db", str(tmp_path / "no.db"), "--out", str(tmp_path / "map2.png")])
    assert bad.exit_code == 2
    assert not (tmp_path / "map2.png").exists()
