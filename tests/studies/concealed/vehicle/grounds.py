"""Grounds of a drive: their classes and soils, which bear one vehicle, and how the soil varies along each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from ..mechanics import Body, Drive, Ground, loaded
from ..soils import SOIL_RANGES, SoilRange, scattered

CLASSES: dict[str, tuple[SoilRange, ...]] = {
    "sand": (SOIL_RANGES["dry sand"], SOIL_RANGES["coarse sand"]),
    "loam": (SOIL_RANGES["sandy loam"],),
    "clay": (SOIL_RANGES["clayey soil"],),
    "gravel": (SoilRange(350.0, 36.0, 0.013, 5.0e3, 3200e3, 0.95),),
    "grass": (SoilRange(3100.0, 29.8, 0.022, 0.06e3, 5880e3, 1.01),),
}
"""Typical soils of each class. Gravel: friction of loose sandy gravel (K. Terzaghi, R. B. Peck, G. Mesri 1996), the
rest chosen, firmer than dry sand; grass: Grenville loam (J. Y. Wong 2010, Table 2.3), k chosen."""

ENTRY_RAD = (0.33, 0.58)
"""Entry angle under the usual load: soft enough to be an instrument, firm enough to be driven on."""

MOST_LOOSE = 8.0
"""How much looser or denser than typical soil is where the vehicle's load demands it: stiffness varies that much with
density and moisture (Wong 2010, Table 2.3: sandy loams alone by a factor of 10)."""


@dataclass(frozen=True)
class Stretches:
    """Classes and soils of the grounds in order along the track, and the usual load of a wheel [N]."""

    classes: tuple[str, ...]
    soils: tuple[Ground, ...]
    usual_load_N: float

    def by_row(self, number: np.ndarray) -> Ground:
        """Give the soil of each row (m, 1) by the number of its ground (m,)."""
        return joined(self.soils, number)

    def of_class(self, name: str) -> tuple[int, ...]:
        """Give the numbers of the grounds of a class."""
        return tuple(index for index, each in enumerate(self.classes) if each == name)


def joined(soils: Sequence[Ground], number: np.ndarray) -> Ground:
    """Give the soil of each row, (m, 1), by its number (m,)."""
    return Ground(*(np.array([getattr(soil, f.name) for soil in soils])[number][:, None] for f in fields(Ground)))


def draw_classes(rng: np.random.Generator) -> tuple[str, ...]:
    """Draw 2 to 5 classes in order; one of them may come twice, with another between."""
    count = int(rng.integers(2, 6))
    again = count > 2 and rng.random() < 0.4
    names = [str(name) for name in rng.permutation(list(CLASSES))[: count - again]]
    if again:
        first = int(rng.integers(len(names) - 1))
        names.insert(int(rng.integers(first + 2, len(names) + 1)), names[first])
    return tuple(names)


def draw_stretches(rng: np.random.Generator, body: Body, classes: Sequence[str]) -> Stretches | None:
    """Draw the soils, as loose as lets the vehicle sink in; None where one would have to be implausibly so."""
    soils = [scattered(rng, CLASSES[name][int(rng.integers(len(CLASSES[name])))], body) for name in classes]
    entries = rng.uniform(*ENTRY_RAD, len(soils))
    loads = np.array([_carried(soil, body, entry) for soil, entry in zip(soils, entries, strict=True)])
    usual = float(np.exp(np.mean(np.log(loads))))
    made = []
    for soil, entry in zip(soils, entries, strict=True):
        looser = soil
        for _ in range(20):  # shear carries a part of the load
            miss = usual / _carried(looser, body, entry)
            looser = replace(looser, stiffness_Pa=float(looser.stiffness_Pa) * miss)
        if not 1.0 / MOST_LOOSE < float(looser.stiffness_Pa) / float(soil.stiffness_Pa) < MOST_LOOSE:
            return None
        made.append(looser)
    return Stretches(tuple(classes), tuple(made), usual)


def _carried(soil: Ground, body: Body, entry_rad: float) -> float:
    zero = np.zeros(1)
    return float(loaded(np.array([entry_rad]), np.array([0.2]), soil, body, Drive(*([zero] * 13)))[0][0])
