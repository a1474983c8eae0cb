"""What an explanation of sound answers: what was located, what it is, and what modelling it gains."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from .explanation import Missing, Verdict

SOUND_NAMES = {
    "gear_mesh": "gear mesh",
    "lug_passing": "lugs passing",
    "wind_noise": "wind noise",
    "resonance": "resonance",
    "steady_tone": "steady tone",
}
"""Names of causes of sound, by their public name in files."""


@dataclass(frozen=True)
class SoundRegion:
    """Where sound exceeds the smooth spectrum of contact sound.

    Parameters
    ----------
    variable
        What stands still there: order of the wheel's turns [-], frequency [Hz], or growth with travel speed [m/s].
    start, end
        Interval of that variable.
    from_Hz, to_Hz
        Frequencies that it swept over during the drive [Hz].
    share
        Of everything that is more than contact sound, measured in nats of held-out likelihood [-].
    p_value
        Against surrogates of the drive, after which the false discovery rate was controlled.
    """

    variable: Literal["wheel_order", "frequency_Hz", "travel_speed"]
    start: float
    end: float
    from_Hz: float
    to_Hz: float
    share: float
    p_value: float

    def to_json(self) -> dict[str, Any]:
        """Lay it out as an entry of the documented JSON's `located`."""
        values = asdict(self)
        return {"channel": "sound", "from": values.pop("start"), "to": values.pop("end"), **values}


@dataclass(frozen=True)
class SoundCause(Missing):
    """A cause of sound that is not contact sound.

    Parameters
    ----------
    nats
        Held-out log-likelihood gained over contact sound without it.
    subtracted
        Whether it is taken away from the sound: only where that brings held-out spectra closer to contact sound.
    """

    nats: float = 0.0
    subtracted: bool = True

    def to_json(self) -> dict[str, Any]:
        """Lay it out as an entry of the documented JSON's `missing`."""
        return super().to_json() | {"subtracted": self.subtracted}


@dataclass(frozen=True)
class SpectralFit:
    """Error of held-out log spectra [dB], root mean square over the cells where something was found, before and after.

    `noise_dB` is what the scatter of a single block's spectrum leaves to a perfect model; n cells were compared.
    """

    split: str
    rms_before_dB: float
    rms_after_dB: float
    noise_dB: float
    nats_gained: float
    nats_sd: float
    n: int


@dataclass(frozen=True)
class SoundFindings:
    """What was found in the sound of a drive.

    The verdict ``"unknown"`` with nothing missing says that there is too little sound.
    """

    verdict: Verdict
    located: tuple[SoundRegion, ...] = ()
    missing: tuple[SoundCause, ...] = ()
    fit: SpectralFit | None = None
    notes: tuple[str, ...] = ()
    seconds: float = field(default=0.0, compare=False)

    def to_json(self) -> dict[str, Any]:
        """Lay the findings out as the documented JSON (schema 1)."""
        return {
            "schema": 1,
            "verdict": self.verdict,
            "located": [region.to_json() for region in self.located],
            "missing": [cause.to_json() for cause in self.missing],
            "fit": None if self.fit is None else asdict(self.fit),
            "notes": list(self.notes),
            "seconds": round(self.seconds, 2),
        }
