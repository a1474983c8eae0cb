"""Wind on the microphone: low rumble that grows with speed faster than any contact sound.

Turbulent pressure goes with V^2, so its power with V^4 at equal Strouhal number f D / V and, since the spectrum falls
with that number, with more at equal frequency: in third octaves V^6.3 f^-2.3 (Strasberg 1988, J. Acoust. Soc. Am. 83,
544, in the form L = 40 lg V - 23 lg(f D / V) + const). Contact sound grows with about V^1 to V^3. Ground and gain
differ from stretch to stretch, so only the growth with speed *within* a stretch is used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from .alignment import FOLDS, HeldOut
from .drive_spectra import DriveSpectra

EXPONENT = (2.5, 7.5)
"""Bounds of the speed exponent m of wind's power [-]."""
SLOPE = (0.5, 5.0)
"""Bounds of the fall s of its power density with frequency [-]."""
REFERENCE_HZ = 100.0
CONTACT_MOST = 3.0
"""Contact sound's power grows with V to at most this [-]: a little more than tyres on roads do at their steepest."""
LEAST_TRAVEL_M_S = 0.05
_LOW_HZ = (22.0, 140.0)
_CONTACT_HZ = (600.0, 5000.0)
_PER_THIRD = 8
_SURROGATES = 300
_MARGIN = 0.7
_ROUNDS = 30


@dataclass(frozen=True)
class Bands:
    """Third-octave levels within stretches: hz (b,), level (n, b) [ln], log_v (n,), stretch (n,)."""

    hz: np.ndarray
    level: np.ndarray
    log_v: np.ndarray
    stretch: np.ndarray

    @staticmethod
    def of(spectra: DriveSpectra) -> Bands:
        """Average the narrow bands' logarithms eight by eight: a line in one of them counts an eighth."""
        moving = spectra.travel_m_s > LEAST_TRAVEL_M_S
        count = spectra.band_hz.size // _PER_THIRD
        narrow = np.log(np.maximum(spectra.band_power[moving, : count * _PER_THIRD], 1e-20)).astype(float)
        hz = spectra.band_hz[: count * _PER_THIRD].reshape(count, _PER_THIRD)
        # Where there are enough, stretches are taken two by two: more speed, and seldom more than one ground, in each.
        pair = 2 if spectra.stretches.size >= 2 * FOLDS else 1
        return Bands(
            np.exp(np.log(hz).mean(axis=1)), narrow.reshape(len(narrow), count, _PER_THIRD).mean(axis=2),
            np.log(spectra.travel_m_s[moving]), spectra.stretch[moving] // pair,
        )  # fmt: skip

    def rows(self, keep: np.ndarray) -> Bands:
        """Only the blocks of a mask (n,)."""
        return Bands(self.hz, self.level[keep], self.log_v[keep], self.stretch[keep])


@dataclass(frozen=True)
class WindModel:
    """Power density of wind, W V^m (f / 100 Hz)^-s [1/Hz of full scale squared], V in m/s."""

    log_w: float
    exponent: float
    slope: float

    def power(self, frequency_hz: np.ndarray, speed_m_s: np.ndarray) -> np.ndarray:
        """Power densities (n, b) at frequencies (b,) [Hz] and speeds (n,) [m/s], at 1 m/s and 100 Hz exp(log_w)."""
        log_f = np.log(np.maximum(frequency_hz, 10.0) / REFERENCE_HZ)
        log_v = np.log(np.maximum(speed_m_s, LEAST_TRAVEL_M_S))
        return np.exp(self.log_w + self.exponent * log_v[:, None] - self.slope * log_f)


@dataclass(frozen=True)
class WindFinding(HeldOut):
    """Wind as fitted, with standard deviations of the law's three numbers, p value against surrogates, growth of the
    low bands with speed, the scatter of one block [dB], the frequencies it is heard between, and the speeds driven.
    """

    model: WindModel
    sd: tuple[float, float, float]
    p_value: float
    growth: float
    noise_dB: float
    low_hz: float
    top_hz: float
    speed_m_s: tuple[float, float]


def find_wind(spectra: DriveSpectra, rng: np.random.Generator) -> WindFinding | str:
    """Look for wind that grows with speed; a sentence says why where the drive cannot show it."""
    bands = Bands.of(spectra)
    if np.unique(bands.stretch).size < FOLDS or bands.log_v.size < 40:
        return "too little sound in motion to distinguish wind from contact sound by its growth with speed"
    spread = float(np.std(_within(bands.log_v, bands.stretch)))
    if spread < 0.03:
        return (
            "speed hardly varied: wind and contact sound cannot be distinguished; "
            "accelerate by a factor of 1.5 or more on one ground"
        )
    if not _is_contact(bands.hz).any():
        return (
            f"nothing above {_CONTACT_HZ[0]:g} Hz was observed, where contact sound is alone: "
            "wind cannot be distinguished from it"
        )
    p_value, growth = _test(bands, rng)
    folds = np.searchsorted(np.unique(bands.stretch), bands.stretch) % FOLDS
    fits = [_fit(bands.rows(folds != held)) for held in range(FOLDS)]
    scores = [_score(bands.rows(folds != held), bands.rows(folds == held), *fit) for held, fit in enumerate(fits)]
    model, contact = _fit(bands)
    each = np.array([[m.log_w, m.exponent, m.slope] for m, _ in fits])
    sd = np.sqrt((FOLDS - 1) / FOLDS * np.sum((each - each.mean(axis=0)) ** 2, axis=0))
    share = _wind_share(bands, model, contact)
    heard = share > 0.2
    if not heard.any():
        return WindFinding(np.zeros(1), 0.0, 0.0, 0, model, (0.0, 0.0, 0.0), 1.0, growth, 0.0, 0.0, 0.0, (0.0, 0.0))
    v = np.exp(bands.log_v[heard.any(axis=1)])
    by_stretch = np.concatenate([s[0] for s in scores])
    return WindFinding(
        by_stretch, sum(s[1] for s in scores), sum(s[2] for s in scores), sum(s[3] for s in scores), model,
        (float(sd[0]), float(sd[1]), float(sd[2])), p_value, growth, _local_noise_dB(bands),
        float(spectra.band_hz[0]), float(bands.hz[np.flatnonzero(heard.any(axis=0))[-1]]),
        (float(v.min()), float(v.max())),
    )  # fmt: skip


def _is_contact(hz: np.ndarray) -> np.ndarray:
    """Bands (b,) in which wind is not heard."""
    return (hz > _CONTACT_HZ[0]) & (hz < _CONTACT_HZ[1])


def _within(values: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Values (n,) or (n, b) less their mean over their stretch."""
    _, own = np.unique(stretch, return_inverse=True)
    count = np.bincount(own)
    if values.ndim == 1:
        return values - (np.bincount(own, values) / count)[own]
    total = np.zeros((count.size, values.shape[1]))
    np.add.at(total, own, values)
    return values - (total / count[:, None])[own]


def _test(bands: Bands, rng: np.random.Generator) -> tuple[float, float]:
    """P value that low bands grow no faster with speed than contact sound may, and their growth exponent."""
    v = _within(bands.log_v, bands.stretch)
    low = (bands.hz > _LOW_HZ[0]) & (bands.hz < _LOW_HZ[1])
    high = _is_contact(bands.hz)
    y = _within(bands.level, bands.stretch)
    slopes = v @ y / (v @ v)
    allowed = max(float(np.median(slopes[high])) + _MARGIN, CONTACT_MOST - 0.4)
    excess = y[:, low].mean(axis=1) - allowed * v
    observed = float(v @ excess / (v @ v))
    # What speed does explain must not count as wandering.
    wandering = excess - observed * v
    numbers = np.unique(bands.stretch)
    drawn = np.empty(_SURROGATES)
    for index in range(_SURROGATES):
        # Speeds of other stretches, turned round: what remains is how low bands wander by themselves.
        mixed = np.concatenate([v[bands.stretch == number] for number in rng.permutation(numbers)])
        mixed = np.roll(mixed, int(rng.integers(len(mixed))))
        drawn[index] = mixed @ wandering / (mixed @ mixed)
    score = observed / max(float(np.std(drawn)), 1e-9)
    return float(stats.norm.sf(score)), observed + allowed


def _fit(bands: Bands) -> tuple[WindModel, np.ndarray]:
    """Fit wind over contact sound; gives the wind and contact's speed exponents (b,).

    Expectation-maximisation of two Gaussian sources by their power (Fevotte, Bertin and Durrieu 2009,
    doi:10.1162/neco.2008.04-08-771): the expected power of each source, then each source's law fitted to its own.
    """
    low = bands.hz < 500.0
    hz, level = bands.hz[low], bands.level[:, low]
    fast = bands.log_v >= np.quantile(bands.log_v, 0.8)
    log_f = np.log(hz / REFERENCE_HZ)
    start = np.median(level[fast], axis=0) - 5.0 * np.median(bands.log_v[fast])
    model = WindModel(float(np.min(start + 2.5 * log_f)) - 0.3, 5.0, 2.5)
    growth = np.full(hz.size, 1.8)
    contact = _within_mean(level, bands.stretch)
    power = np.exp(level)
    for _ in range(_ROUNDS):
        wind = model.power(hz, np.exp(bands.log_v))
        ground = np.exp(contact + growth * _within(bands.log_v, bands.stretch)[:, None])
        share = wind / (wind + ground)
        own = share**2 * power + share * ground
        rest = (1.0 - share) ** 2 * power + (1.0 - share) * wind
        model = _wind_law(np.log(own + 1e-30), share, log_f, bands.log_v)
        contact, growth = _contact_law(np.log(rest + 1e-30), 1.0 - share, bands)
    full = np.full(bands.hz.size, float(np.median(growth)))
    full[low] = growth
    return model, full


def _within_mean(level: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    return level - _within(level, stretch)


def _wind_law(log_power: np.ndarray, weight: np.ndarray, log_f: np.ndarray, log_v: np.ndarray) -> WindModel:
    """Weighted least squares of log W, m, s on the logarithm of wind's expected power, within bounds."""
    v, f = np.broadcast_to(log_v[:, None], log_power.shape), np.broadcast_to(log_f, log_power.shape)
    design = np.stack([np.ones(log_power.size), v.ravel(), -f.ravel()])
    # Tied weakly to Strasberg's exponents where the data say little; a thousandth of the weight of one block.
    w = weight.ravel() + 1e-9
    prior = np.diag([1e-9, 0.5, 0.5]) * 4.0
    solved = np.linalg.solve(
        (design * w) @ design.T + prior, (design * w) @ log_power.ravel() + prior @ [0.0, 6.0, 3.3]
    )
    exponent, slope = float(np.clip(solved[1], *EXPONENT)), float(np.clip(solved[2], *SLOPE))
    log_w = float(np.average(log_power.ravel() - exponent * v.ravel() + slope * f.ravel(), weights=w))
    return WindModel(log_w, exponent, slope)


def _contact_law(log_power: np.ndarray, weight: np.ndarray, bands: Bands) -> tuple[np.ndarray, np.ndarray]:
    """Contact sound's level in each stretch and band (n, b), and its growth with speed in each band (b,)."""
    v = _within(bands.log_v, bands.stretch)
    mean = _within_mean(log_power, bands.stretch)
    growth = np.sum(weight * v[:, None] * (log_power - mean), axis=0) / (
        np.sum(weight * v[:, None] ** 2, axis=0) + 1e-9
    )
    return mean, np.clip(growth, 0.0, CONTACT_MOST)


def _predicted(bands: Bands, model: WindModel | None, growth: np.ndarray) -> np.ndarray:
    """Expected level (n, b); each stretch's own contact level is fitted to it, with the wind or without."""
    slope = growth * _within(bands.log_v, bands.stretch)[:, None]
    contact = _within_mean(bands.level, bands.stretch)
    if model is None:
        return contact + slope
    wind = model.power(bands.hz, np.exp(bands.log_v))
    for _ in range(20):
        ground = np.exp(contact + slope)
        missing = bands.level - np.log(ground + wind)
        step = _within_mean(missing, bands.stretch) / np.maximum(
            _within_mean(ground / (ground + wind), bands.stretch), 0.1
        )
        contact = contact + np.clip(step, -1.0, 1.0)
    return np.log(np.exp(contact + slope) + wind)


def _errors(bands: Bands, model: WindModel, growth: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors (n, b) of the low bands without wind and with it, and where wind is a quarter of the power or more."""
    low = bands.hz < 500.0
    with_wind = _predicted(bands, model, growth)
    # Without wind the contact sound may grow as fast as it likes up to its bound: the rival at its best.
    v = _within(bands.log_v, bands.stretch)
    own = np.clip(v @ _within(bands.level, bands.stretch) / max(float(v @ v), 1e-9), 0.0, CONTACT_MOST)
    heard = model.power(bands.hz[low], np.exp(bands.log_v)) > 0.25 * np.exp(with_wind[:, low])
    return (bands.level - _predicted(bands, None, own))[:, low], (bands.level - with_wind)[:, low], heard


def _score(train: Bands, held: Bands, model: WindModel, growth: np.ndarray) -> tuple[np.ndarray, float, float, int]:
    """Gain of a held-out fold by stretch [nats], and squared errors before and after [dB^2] over n cells."""
    fitted = _errors(train, model, growth)
    before, after, heard = _errors(held, model, growth)
    var = [np.maximum(np.mean(part**2, axis=0), 1e-3) for part in fitted[:2]]
    each = 0.5 * (before**2 / var[0] - after**2 / var[1] + np.log(var[0] / var[1]))
    gain = _independent_share(before) * each.sum(axis=1)
    by_stretch = np.array([gain[held.stretch == number].sum() for number in np.unique(held.stretch)])
    dB2 = (10.0 / np.log(10.0)) ** 2
    return by_stretch, float(dB2 * (before[heard] ** 2).sum()), float(dB2 * (after[heard] ** 2).sum()), int(heard.sum())


def _independent_share(error: np.ndarray) -> float:
    """How many independent values errors (n, b) are worth, over n b: neighbours in time and frequency are alike."""
    z = error / np.maximum(error.std(axis=0), 1e-9)
    in_time = float(np.clip(np.mean(z[1:] * z[:-1]), 0.0, 0.95))
    across = float(np.clip((np.mean(z.mean(axis=1) ** 2) * z.shape[1] - 1.0) / (z.shape[1] - 1), 0.0, 1.0))
    return (1.0 - in_time) / (1.0 + in_time) / (1.0 + (z.shape[1] - 1) * across)


def _wind_share(bands: Bands, model: WindModel, growth: np.ndarray) -> np.ndarray:
    return model.power(bands.hz, np.exp(bands.log_v)) / np.exp(_predicted(bands, model, growth))


def _local_noise_dB(bands: Bands) -> float:
    """Scatter of low bands from local differences [dB]: blocks two apart do not overlap."""
    low = bands.hz < 500.0
    same = bands.stretch[2:] == bands.stretch[:-2]
    step = (bands.level[2:, low] - bands.level[:-2, low])[same]
    return float(10.0 / np.log(10.0) * np.sqrt(np.mean(step**2) / 2.0)) if step.size else 0.0
