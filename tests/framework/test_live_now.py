"""What a drive says of itself while it goes on."""

from __future__ import annotations

import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bevameter import ClassEvidence, TerrainDatabase
from bevameter.audio.vibration_sense import Vibration
from bevameter.database.posterior import class_soils
from bevameter.framework.default_models import Models
from bevameter.framework.live.events import GroundChanged
from bevameter.framework.live.log import WheelRow
from bevameter.framework.live.soil import SoilWatch
from bevameter.framework.senses import SENSES, Observation, Sense
from live_drives import begun


def test_changes_of_the_ground_are_told_where_they_are(driven):
    _, _, seen, _ = driven
    changes = [each for each in seen.events if isinstance(each, GroundChanged)]
    assert [each.after for each in changes] == ["sand", "loam", "grass"]
    assert [each.before for each in changes] == ["", "sand", "loam"]
    assert [each.time_s for each in changes] == pytest.approx([0.0, 32.0, 64.0], abs=3.0)  # a metre
    assert all(each.probability >= 2.0 / 3.0 for each in changes)


def test_the_ground_ahead_is_known_and_each_sense_is_trusted_or_not(driven):
    _, _, seen, _ = driven
    known = [(~belief.unknown).mean() for belief in seen.ahead if len(belief)]
    assert np.median(known) > 0.2
    assert {name for belief in seen.ahead for name in belief.labels()} >= {"sand", "loam"}
    said = [trust["audio"] for trust in seen.trust]
    assert any(each.is_trusted for each in said)
    assert any(not each.is_trusted and each.reasons for each in said)


def test_the_soil_in_progress_is_told_with_its_interval_and_what_would_help(driven):
    drive, _, seen, _ = driven
    found = [soil for soil in seen.soils if soil is not None and soil.n >= 100]
    assert {soil.class_name for soil in found} == {"sand", "loam"}
    for soil in found:
        final = next(each for each in drive.soils if each.estimate is not None and max(
            each.class_probabilities, key=each.class_probabilities.get) == soil.class_name)  # fmt: skip
        phi, whole = soil.parameters["phi_rad"], final.estimate.parameters["phi_rad"]
        assert phi.low < whole.high
        assert whole.low < phi.high
    fast = [soil for soil in seen.soils if soil is not None and soil.reason.startswith("too fast")]
    assert all(soil.advice.startswith("drive more slowly") for soil in fast)
    assert fast


def test_the_snapshot_on_the_way_is_that_of_the_database_in_the_end(driven):
    """But for looks that are laid elsewhere, and weighed otherwise, once the whole drive is known."""
    _, _, seen, stored = driven
    here, there = seen.snapshot, stored
    common, a, b = np.intersect1d(here.cells.key, there.cells.key, return_indices=True)
    assert len(common) > 0.97 * len(there.cells.key)
    assert here.class_names == there.class_names
    both = np.isfinite(here.cells.probability[a]).all(axis=1) & np.isfinite(there.cells.probability[b]).all(axis=1)
    same = here.cells.probability[a][both].argmax(axis=1) == there.cells.probability[b][both].argmax(axis=1)
    assert same.mean() > 0.98


def test_soils_of_complete_stretches_are_in_the_snapshot_before_the_drive_is_stored(driven):
    """As a run identifies them, and for classes of which nothing was stored."""
    _, _, seen, stored = driven
    assert set(seen.soils_on_the_way) == set(stored.soils) == {"sand", "loam"}
    for name, soil in stored.soils.items():
        early = seen.soils_on_the_way[name].strength
        sd = np.sqrt(np.diag(soil.strength.noise[0]))
        assert np.all(np.abs(early.mean - soil.strength.mean) < sd)


@pytest.mark.parametrize(("share", "departs"), [(1.0, False), (2.5, True)])
def test_a_soil_that_is_not_that_of_its_class_is_told(live_recording, stored_drive, share, departs):
    """Sand that bears 1 / `share` of what is stored of it."""
    sand = next(each for each in stored_drive[0].soils if each.estimate is not None)
    c, tan_phi = share * sand.estimate.mean_c_tan_phi
    known = replace(sand, estimate=replace(sand.estimate, mean_c_tan_phi=np.array([c, tan_phi])))
    places = [replace(known, start_s=1e3 * number, end_s=1e3 * number + 20.0) for number in range(8)]
    told = []
    watch = SoilWatch(live_recording.vehicle, class_soils(places), told.append)
    watch.begin()
    watch.begin_stretch(0.0, "sand")
    names = [name for name in live_recording.wheel.columns if name != "time_s"]
    for row, time_s in enumerate(live_recording.wheel["time_s"][:100].tolist()):
        watch.put(time_s, WheelRow("", {name: float(live_recording.wheel[name][row]) for name in names}))
    watch.end()
    assert [each.class_name for each in told] == ["sand"] * departs
    if departs:
        assert told[0].strength_share == pytest.approx(1.0 / share, abs=0.15)
    assert watch.now.n > 40


def test_vibration_and_senses_of_others_observe_on_the_way(live_recording, tmp_path, monkeypatch):
    """One sense of another package sees images, beside the camera's own; vibration is heard piece by piece."""
    seen, pieces = [], []

    class Thermal(Sense):
        name, instrument = "thermal", "thermal camera"

        def train(self, labelled, rng, *, notes=()): ...
        def classify(self, files, model): ...

        def absence(self, recording):
            return "" if recording.camera is not None else "no camera"

        def observe(self, recording, track, model, cell_size_m):
            for frame in recording.camera.frames():
                seen.append(frame.time_s)
                at = np.array([frame.time_s])
                yield Observation.under_wheels(evidence("ice"), at - 0.05, at, recording, track, cell_size_m)

    def observe(self, recording, track, model, cell_size_m):
        run = recording.vibration
        pieces.append((run.time_s[0], run.time_s[-1]))
        yield Observation.under_wheels(evidence("loam"), run.time_s[:1], run.time_s[-1:], recording, track, cell_size_m)

    monkeypatch.setitem(SENSES, "thermal", Thermal())
    monkeypatch.setattr(Vibration, "observe", observe)
    model = SimpleNamespace(version="1", classes=("ice", "loam"))
    models = Models({"thermal": model, "vibration": model}, {})
    live = begun(live_recording, models, tmp_path / "t.db")
    image = np.zeros((48, 64, 3), np.uint8)
    for number in range(1500):
        time_s = 0.02 * number
        live.pose(time_s, 0.5 * time_s, 0.0, 0.0)
        live.imu(time_s, wx=0.0, wy=0.0, wz=0.0, ax=np.sin(40 * time_s), ay=0.0, az=9.81)
        if number % 10 == 0:
            live.image(time_s, image)
    until = time.monotonic() + 10.0
    while len(pieces) < 4 and time.monotonic() < until:
        time.sleep(0.02)
    trust = live.trust()
    assert {name for name, each in trust.items() if each.is_trusted} == {"thermal", "vibration"}
    assert {*live.snapshot().class_names} >= {"ice", "loam"}
    assert len(pieces) == 4  # of 6.4 s, in half a minute
    assert all(6.0 < end - start < 6.8 for start, end in pieces)
    assert live.problems == ()
    drive = closed(live, tmp_path / "t.db")
    assert pieces[-1] == pytest.approx((0.0, 29.98))  # once more, as a run does
    assert len(seen) == 150
    assert set(drive.terrain.evidence.classes) == {"ice", "loam"}


def evidence(name):
    classes = ("ice", "loam")
    probabilities = np.array([[0.9 if each == name else 0.1 for each in classes]])
    return ClassEvidence(classes, probabilities, np.array([0.8]), np.zeros(1, bool), ((),))


def closed(live, path):
    live.close()
    with TerrainDatabase(path) as database:
        return database.drives()[0]
