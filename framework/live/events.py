"""What a drive tells those who subscribe to it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class GroundChanged:
    """The ground under the wheels is of another class.

    Parameters
    ----------
    time_s
        When the wheels came onto it [s].
    before, after
        The classes; empty where none is probable enough.
    probability
        That of the new one [-].
    """

    time_s: float
    before: str
    after: str
    probability: float


@dataclass(frozen=True)
class SensesContradict:
    """Senses that are trusted name different classes of the ground under the wheels.

    Parameters
    ----------
    time_s
        When the wheels were there [s].
    said
        What each says, in words.
    """

    time_s: float
    said: str


@dataclass(frozen=True)
class SoilDeparts:
    """What the wheels feel is not what the stored soil of the class predicts: drive slowly.

    Parameters
    ----------
    time_s
        When the test said so [s].
    class_name
        The class that the senses name.
    strength_share
        Shear strength over that of the class [-]: below 1 the ground is weaker.
    log_ratio
        Logarithm of the likelihood of any soil over that of the class's [-].
    """

    time_s: float
    class_name: str
    strength_share: float
    log_ratio: float


@dataclass(frozen=True)
class Trouble:
    """Something fails, or works again.

    Parameters
    ----------
    time_s
        When [s].
    text
        What, in words.
    """

    time_s: float
    text: str


Event = GroundChanged | SensesContradict | SoilDeparts | Trouble
