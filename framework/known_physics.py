"""What a terrain database knows of the physics of its classes, on a drive that comes later."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..database.observations import SoilEffect
from ..database.physics import ClassPhysics
from ..identification.effects.stored import AugmentedSimulator
from ..identification.later_drives import for_later_drives, without_effects
from ..identification.mechanics.textbook import ANSWERS
from ..identification.rows.on_track import with_places
from ..identification.rows.weight import with_loads
from .core.errors import InputError
from .core.recording.types import Recording, WheelTable
from .core.track.way import Track
from .segments import ClassTrack, stretches


@dataclass(frozen=True)
class KnownPhysics:
    """Soil and effects by class, those that act on a certain vehicle's later drives; none of them empty."""

    by_class: Mapping[str, AugmentedSimulator]

    @staticmethod
    def of(known: Sequence[ClassPhysics], recording: Recording) -> KnownPhysics:
        """Choose from what a database knows, oldest first, the newest physics of each class at the recording's site, as
        it acts on the recording's vehicle; nothing where there are no wheel channels.
        """
        if recording.wheel is None or recording.vehicle is None:
            return KnownPhysics({})
        stored = sorted(known, key=lambda each: each.site != "")  # the site's own counts more
        newest = {each.class_name: each.physics for each in stored if each.site in ("", recording.site)}
        acting = {name: for_later_drives(physics, recording.vehicle.identity) for name, physics in newest.items()}
        return KnownPhysics({name: physics for name, physics in acting.items() if physics.effects})

    @property
    def digest(self) -> str:
        """Short name of what is known; empty where nothing is."""
        documents = {name: physics.to_json() for name, physics in self.by_class.items()}
        return hashlib.sha256(json.dumps(documents, sort_keys=True).encode()).hexdigest()[:12] if documents else ""

    def effects(self, class_name: str) -> tuple[SoilEffect, ...]:
        """Return the effects of a class as a stretch's observation names them."""
        physics = self.by_class.get(class_name)
        return tuple(
            SoilEffect(effect.slug, {name: entry.value for name, entry in effect.parameters.items()})
            for effect in (physics.effects if physics is not None else ())
        )

    def taken_out(
        self, recording: Recording, track: Track, along: ClassTrack
    ) -> tuple[Recording, KnownPhysics, tuple[str, ...]]:
        """Subtract what the effects add to the wheel channels where the track is of their class.

        Parameters
        ----------
        recording
            With wheel channels, on a clock, and a vehicle.
        track, along
            Where it was, and the class along the track.

        Returns
        -------
        tuple
            The recording, what was subtracted, and why the rest was not.
        """
        wheel, vehicle, used, problems = recording.wheel, recording.vehicle, {}, []
        assert wheel is not None
        assert vehicle is not None
        placed, label = (
            with_places(with_loads(wheel, vehicle, recording.pose)[0], vehicle, track),
            _classes_of(wheel, along),
        )
        columns = dict(wheel.columns)
        for name in sorted({*self.by_class} & {*label.tolist()}):
            try:
                bare = without_effects(self.by_class[name], vehicle, placed)
            except InputError as error:
                problems.append(f"what is known of {name} was not used: {error}")
                continue
            columns |= {each: np.where(label == name, bare[each], columns[each]) for each in ANSWERS if each in columns}
            used[name] = self.by_class[name]
        return replace(recording, wheel=replace(wheel, columns=columns)), KnownPhysics(used), tuple(problems)


def _classes_of(wheel: WheelTable, along: ClassTrack) -> np.ndarray:
    """Name of the class of each row (n,), that of its stretch; empty where it is not sure."""
    names = np.full(len(wheel), "", dtype=object)
    for each in stretches(along):
        names[(wheel["time_s"] >= each.start_s) & (wheel["time_s"] <= each.end_s)] = each.class_name
    return names
