"""What `explain_sound` answers: what was located, what it is, how the sound was cleaned, and what that gained."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Literal

Variable = Literal["wheel_order", "frequency_Hz", "travel_speed"]
Kind = Literal["instrument", "physics"]

SLUGS = ("gear_mesh", "lug_passing", "wind_noise", "resonance", "steady_tone", "unknown")
"""Public names of what sound may hold beside contact sound."""

EQUATIONS = {
    "gear_mesh": "sum_k a_k cos(k o theta(t) + phi_k), theta the wheel's angle, o the mesh order",
    "lug_passing": "g(N theta(t)), periodic in the wheel's angle with N lugs a turn",
    "wind_noise": "S_w(f, V) = W (V / 1 m/s)^m (f / 100 Hz)^-s",
    "resonance": "|H(f)|^2 = 1 + G / (1 + (2 Q (f - f_0) / f_0)^2)",
    "steady_tone": "a cos(2 pi f_0 t + phi)",
    "unknown": "a cos(o theta(t) + phi)",
}
SOURCES = {
    "gear_mesh": "Randall 2011, Vibration-based Condition Monitoring, ch. 2 (tooth meshing, harmonics and sidebands)",
    "lug_passing": "Randall 2011, ch. 5 (envelope analysis); Fyfe and Munck 1997, doi:10.1006/mssp.1996.0056",
    "wind_noise": "Strasberg 1988, J. Acoust. Soc. Am. 83, 544 (per third octave p^2 ~ V^6.3 f^-2.3 at fixed screen)",
    "resonance": "Single degree of freedom, Randall 2011, ch. 2",
    "steady_tone": "A sinusoid of fixed frequency",
    "unknown": "",
}
KINDS: dict[str, Kind] = {
    "gear_mesh": "instrument", "lug_passing": "physics", "wind_noise": "instrument", "resonance": "instrument",
    "steady_tone": "instrument", "unknown": "instrument",
}  # fmt: skip
"""Lugs meet the ground; everything else is a disturbance of the instrument."""


@dataclass(frozen=True)
class Parameter:
    """An estimated number, its standard deviation (None where it was not estimated but given) and their unit.

    The number itself is None where it cannot be known; a note says why.
    """

    value: float | None
    sd: float | None
    unit: str


@dataclass(frozen=True)
class Located:
    """Where sound exceeds the smooth spectrum of contact sound.

    Parameters
    ----------
    variable
        What stands still there: order of the wheel's turns [-], frequency [Hz], or growth with travel speed [m/s].
    low, high
        Interval of that variable.
    from_Hz, to_Hz
        Frequencies that it swept over during the drive [Hz].
    share
        Of everything that is more than contact sound, measured in nats of held-out likelihood [-].
    p_value
        Against surrogates of the drive, after which the false discovery rate was controlled.
    """

    variable: Variable
    low: float
    high: float
    from_Hz: float
    to_Hz: float
    share: float
    p_value: float


@dataclass(frozen=True)
class Explained:
    """One cause that is asserted.

    Parameters
    ----------
    effect
        One of `SLUGS`.
    probability
        That this is its name.
    parameters
        By name.
    orders, frequencies_Hz
        Its lines: multiples of the wheel's turns [-], or fixed [Hz].
    indistinguishable_from
        Other names that these data leave open.
    would_tell
        What measurement would tell them apart; empty where nothing is open.
    nats
        Held-out log-likelihood gained over contact sound without it.
    applied
        Whether it is subtracted: only where that brings held-out spectra closer to contact sound.
    """

    effect: str
    probability: float
    parameters: dict[str, Parameter]
    nats: float
    orders: tuple[float, ...] = ()
    frequencies_Hz: tuple[float, ...] = ()
    indistinguishable_from: tuple[str, ...] = ()
    would_tell: str = ""
    applied: bool = True

    def to_json(self) -> dict:
        """Give the cause as CONTRACTS.md has it under `missing`."""
        return {
            "effect": self.effect,
            "kind": KINDS[self.effect],
            "probability": round(self.probability, 4),
            "parameters": {name: asdict(value) for name, value in self.parameters.items()},
            "equation": EQUATIONS[self.effect],
            "source": SOURCES[self.effect],
            "indistinguishable_from": list(self.indistinguishable_from),
            "would_tell": self.would_tell,
            "subtracted": self.applied,
        }


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
    """What was found: the JSON of it is `to_json`."""

    verdict: str
    located: tuple[Located, ...]
    missing: tuple[Explained, ...]
    fit: SpectralFit | None
    notes: tuple[str, ...] = ()
    seconds: float = field(default=0.0, compare=False)

    def to_json(self) -> dict:
        """Give the findings as JSON-able values in the form of CONTRACTS.md (`bevameter explain`)."""
        return {
            "schema": 1,
            "verdict": self.verdict,
            "located": [
                {"channel": "sound", "variable": p.variable, "from": p.low, "to": p.high, "from_Hz": p.from_Hz,
                 "to_Hz": p.to_Hz, "share": p.share, "p_value": p.p_value}
                for p in self.located
            ],
            "missing": [cause.to_json() for cause in self.missing],
            "fit": None if self.fit is None else asdict(self.fit),
            "notes": list(self.notes),
            "seconds": round(self.seconds, 2),
        }  # fmt: skip
