"""Frames and sound come from the recording with the drive's digest; explanations from its wheels."""

from __future__ import annotations

import io
import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
import soundfile

try:
    import bokeh  # noqa: F401
    import datashader  # noqa: F401
except ModuleNotFoundError:
    pytest.skip("the extra view is not installed", allow_module_level=True)

from bevameter import SoilEstimate, TerrainDatabase
from bevameter.database.observations import Drive, SoilObservation, TerrainObservations
from bevameter.framework.core.recording.readers import read_recording
from bevameter.framework.core.soil import Quantity
from bevameter.framework.view.explanations import explanations
from bevameter.framework.view.map_page import MapPage
from bevameter.framework.view.pages import PAGE_BODIES
from bevameter.framework.view.recordings import Recordings, frame_jpeg, sound_wav
from bevameter.framework.view.server import Shared
from bevameter.framework.view.site import Site
from bevameter.identification.effects.stored import AugmentedSimulator
from bokeh.document import Document
from slow_drive import VEHICLE, drive

RATE = 8000
PHYSICS = AugmentedSimulator.from_json({
    "schema": 2,
    "soil": {
        "c_Pa": {"value": 300.0, "sd": 40.0}, "phi_rad": {"value": 0.54, "sd": 0.01},
        "k_m": {"value": 0.012, "sd": None}, "stiffness_Pa": {"value": 9e4, "sd": 2e3}, "n": {"value": 0.9, "sd": 0.02},
    },
    "effects": [{
        "slug": "slip_sinkage", "form": "exponent", "parameters": {"n1": {"value": 0.4, "sd": 0.05}}, "constants": {},
        "probability": 0.98,
    }],
    "correlation": None,
})  # fmt: skip


@pytest.fixture
def folder(tmp_path, rng):
    """Two folders deep: three frames of one grey each, ten seconds of a rising tone, and a wheel."""
    place = tmp_path / "archive" / "monday" / "quarry drive"
    (place / "camera").mkdir(parents=True)
    lines = ["time_s,file"]
    for number, (time_s, grey) in enumerate(((1.0, 40), (2.0, 120), (5.0, 220))):
        cv2.imwrite(str(place / "camera" / f"{number}.png"), np.full((30, 40, 3), grey, np.uint8))
        lines.append(f"{time_s},{number}.png")
    (place / "camera" / "camera.csv").write_text("\n".join(lines) + "\n")
    soundfile.write(place / "sound.wav", np.repeat(np.arange(10) / 10.0, RATE), RATE)
    wheel = VEHICLE.wheels[0]
    (place / "vehicle.toml").write_text(f"[wheel]\nradius_m = {wheel.radius_m}\nwidth_m = {wheel.width_m}\n")
    table = drive(rng, stretch_s=20.0)
    names = list(table.columns)
    rows = np.column_stack([table[name] for name in names])
    np.savetxt(place / "wheel.csv", rows, delimiter=",", header=",".join(names), comments="")
    (tmp_path / "archive" / "notes.txt").write_text("nothing")
    return tmp_path / "archive"


def test_a_recording_is_found_by_its_digest(folder):
    recording = read_recording(folder / "monday" / "quarry drive")
    recordings = Recordings(folder)
    recordings.start(frozenset({recording.digest, "another"})).join()
    assert recordings.of("another") is None
    found = recordings.of(recording.digest)
    for time_s, grey in ((0.0, 40), (1.6, 120), (100.0, 220)):
        image = cv2.imdecode(np.frombuffer(frame_jpeg(found, time_s), np.uint8), cv2.IMREAD_COLOR)
        assert abs(float(image.mean()) - grey) < 3
    samples, rate = soundfile.read(io.BytesIO(sound_wav(found, 5.5)))
    assert rate == RATE
    assert len(samples) == 2 * RATE
    assert samples.mean() == pytest.approx(0.5, abs=0.03), "around that time"
    assert sound_wav(found, 1e6) is None
    assert frame_jpeg(replace(found, camera=None), 1.0) is None


def stored(path, digest: str, class_soil: SoilObservation) -> TerrainDatabase:
    database = TerrainDatabase(path)
    database.add_drive(
        Drive(digest, "quarry drive", "quarry", "rover", None, {}, "m", TerrainObservations.nothing(), (class_soil,))
    )
    database.add_physics("sand", PHYSICS, source="quarry drive")
    return database


def test_tracks_appear_on_an_open_page_when_their_recordings_are_found(folder, tmp_path):
    place = folder / "monday" / "quarry drive"
    (place / "pose.csv").write_text("time_s,x_m,y_m,yaw_rad\n0,0,0,0\n10,5,0,0\n20,10,0,0\n")
    recording = read_recording(place)
    soil = SoilObservation(2.0, 12.0, math.nan, math.nan, {"sand": 0.97}, estimate(), (5e3, 3e4), 110.0)
    recordings = Recordings(folder)
    recordings._searching = True
    with stored(tmp_path / "terrain.db", recording.digest, soil) as database:
        site = Site.read(database, database.reader("quarry"))
        page, document = MapPage(site, Shared(database, recordings)), Document()
        page.add_to(document)
        page.show_found()
        assert page.map._tracks.data["xs"] == []
        assert len(document.session_callbacks) == 1
        recordings.search(frozenset({recording.digest}))
        page.show_found()
    (x_m,) = page.map._tracks.data["xs"]
    assert (x_m[0], x_m[-1]) == (0.0, 10.0)
    assert document.session_callbacks == [], "nothing more is looked for"


def test_what_is_missing_in_words_and_curves(folder, tmp_path):
    recording = read_recording(folder / "monday" / "quarry drive")
    table = recording.wheel
    soil = SoilObservation(2.0, 12.0, math.nan, math.nan, {"sand": 0.97}, estimate(), (5e3, 3e4), 110.0)
    with stored(tmp_path / "terrain.db", recording.digest, soil) as database:
        site = Site.read(database, database.reader("quarry"))
        alone = PAGE_BODIES["physics"](site, Shared(database, Recordings()), "")
        assert "Missing: slip-sinkage (98 %)" in alone
        assert "A slipping wheel carries soil out from under itself" in alone
        assert "n = n0 + n1 |i|" in alone
        assert "0.400&nbsp;±&nbsp;0.050" in alone
        assert "<img" not in alone
        assert "bevameter explain RECORDING --db" in alone

        chosen = Shared(database, Recordings(), {"rover": VEHICLE}, "rover")
        simulated = explanations(site, chosen)
        assert simulated.count("<img") == 3
        assert "Simulated for a wheel of rover under 110 N" in simulated

        recordings = Recordings(folder)
        recordings.search(frozenset({recording.digest}))
        measured = explanations(site, Shared(database, recordings))
        rows = int(np.sum((table["time_s"] >= 2.0) & (table["time_s"] <= 12.0)))
        assert f"quarry drive, stretches on sand that measured soil: {rows} rows of the wheels" in measured
        assert measured.count("<img") == 2, "no drawbar pull was recorded"


def estimate() -> SoilEstimate:
    parameters = {"c_Pa": Quantity(300.0, 40.0, 220.0, 380.0), "phi_rad": Quantity(0.54, 0.01, 0.52, 0.56)}
    return SoilEstimate(
        parameters, np.array([300.0, 0.6]), np.diag([1600.0, 1e-4]), {}, (), {}, "", "ml", ("load_N",), 50, 1.0
    )
