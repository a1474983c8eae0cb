"""How far the ground's own signal stands above noise, estimated from features by what known noise did to training data.

Noise has no yardstick of its own: whether a rumble, a grain or a tremble is noise or the ground depends on what the
classifier was trained on. So noise of known strength is added to copies of the training data, and a regression learns
to tell how much of it there is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

NOISE_FREE_DB = 35.0
"""What is said of training data as they came [dB]: their own noise is not known, and more would change nothing."""
_APART_DB, _WIDE_DB = 3.0, 20.0
"""Minimum separation of the estimates for clean and noisy training data, and the width of the range over which quality
falls where they are not separated or no noisy data exist [dB]."""
_DEEPEST_DB = 15.0
"""So far below the ratio at which nothing can be trusted, ratios are not distinguished [dB]."""
_LIMIT = 6.0
_RIDGE = (10.0, 100.0, 1000.0, 10000.0)


@dataclass(frozen=True)
class SignalToNoise:
    """A regression of the signal-to-noise ratio on features, and what its estimates leave of the quality.

    Parameters
    ----------
    mean, scale : (d,)
        Of the features.
    coefficient : (d,) or (2 d,)
        Ridge regression on standard scores, and on their squares where there are twice as many (Hoerl and Kennard 1970,
        doi:10.1080/00401706.1970.10488634).
    intercept
        [dB].
    low_dB, high_dB
        Estimates at which the quality reaches 0 and 1.
    """

    mean: np.ndarray
    scale: np.ndarray
    coefficient: np.ndarray
    intercept: float
    low_dB: float
    high_dB: float

    @staticmethod
    def fit(
        inputs: np.ndarray, snr_dB: np.ndarray, groups: np.ndarray, *, drowned_dB: float, squares: bool = False
    ) -> tuple[SignalToNoise, np.ndarray]:
        """Fit to training data with known noise added.

        Strength of the regularisation and both thresholds come from groups held out of the fit.

        Parameters
        ----------
        inputs : (n, d)
            Features, finite.
        snr_dB : (n,)
            Ratio of signal to added noise [dB]; `NOISE_FREE_DB` where none was.
        groups : (n,)
            What must stay on one side of a split.
        drowned_dB
            Ratio at which nothing is to be trusted any more [dB].
        squares
            Whether squares of the features take part, too.

        Returns
        -------
        model
            Fitted to all of it.
        held_dB : (n,)
            What models that have not seen its group estimate of each [dB].
        """
        from sklearn.linear_model import Ridge
        from sklearn.model_selection import GroupKFold

        mean, scale = inputs.mean(axis=0), np.maximum(inputs.std(axis=0), 1e-6)
        z = _scores(inputs, mean, scale, squares)
        # How deep a signal is drowned does not matter, and would bend the line where it does.
        target = np.clip(snr_dB, drowned_dB - _DEEPEST_DB, NOISE_FREE_DB)
        splits = min(5, len(np.unique(groups)))
        folds = list(GroupKFold(splits).split(z, groups=groups)) if splits > 1 else [(np.arange(len(z)),) * 2]
        held: dict[float, np.ndarray] = {}
        for alpha in _RIDGE:
            held[alpha] = np.empty(len(z))
            for train, test in folds:
                held[alpha][test] = Ridge(alpha=alpha).fit(z[train], target[train]).predict(z[test])
        alpha = min(_RIDGE, key=lambda a: float(np.mean((held[a] - target) ** 2)))
        ridge = Ridge(alpha=alpha).fit(z, target)
        free, drowned = snr_dB >= NOISE_FREE_DB, np.abs(snr_dB - drowned_dB) < 3.0
        high = float(np.quantile(held[alpha][free], 0.25))
        low = float(np.median(held[alpha][drowned])) if drowned.any() else high
        if low > high - _APART_DB:
            low = high - _WIDE_DB  # the estimates do not separate clean from noisy data: do not reject clean data
        model = SignalToNoise(mean, scale, ridge.coef_, float(ridge.intercept_), low, high)
        return model, held[alpha]

    def estimate(self, inputs: np.ndarray) -> np.ndarray:
        """Estimate the signal-to-noise ratio [dB] from inputs (n, d): (n,), NaN where one is."""
        squares = len(self.coefficient) > len(self.mean)
        return _scores(inputs, self.mean, self.scale, squares) @ self.coefficient + self.intercept

    def clear(self, ratio_dB: np.ndarray) -> np.ndarray:
        """Give the share of the quality that noise leaves at these ratios (n,) [dB], (n,); 0 where one is NaN."""
        return np.nan_to_num(np.clip((ratio_dB - self.low_dB) / (self.high_dB - self.low_dB), 0.0, 1.0))

    def settings(self) -> dict:
        """Give the model as JSON-able numbers."""
        return {
            name: np.round(value, 9).tolist() if isinstance(value, np.ndarray) else float(value)
            for name, value in vars(self).items()
        }

    @staticmethod
    def from_settings(settings: object, width: int) -> SignalToNoise:
        """Make the model of `width` inputs from its settings; raises `ValueError` where they are no such model."""
        given = settings.get("coefficient") if isinstance(settings, dict) else None
        squares = isinstance(given, list) and len(given) == 2 * width
        sizes: dict[str, int | None] = {"mean": width, "scale": width, "coefficient": (1 + squares) * width}
        parts = checked_numbers(settings, sizes | dict.fromkeys(_ONE))
        if not (parts["scale"] > 0).all() or parts["high_dB"] <= parts["low_dB"]:
            raise ValueError("the noise model is damaged")
        return SignalToNoise(
            parts["mean"], parts["scale"], parts["coefficient"], *(float(parts[name]) for name in _ONE)
        )


_ONE = ("intercept", "low_dB", "high_dB")


def _scores(inputs: np.ndarray, mean: np.ndarray, scale: np.ndarray, squares: bool) -> np.ndarray:
    """Standard scores of inputs (n, d), (n, d); with their squares (n, 2 d)."""
    z = np.clip((inputs - mean) / scale, -_LIMIT, _LIMIT)
    return np.concatenate([z, z**2], axis=1) if squares else z


def checked_numbers(settings: object, sizes: dict[str, int | None]) -> dict[str, np.ndarray]:
    """Give the parts of a noise model as arrays of these sizes, numbers where None; raises `ValueError`."""
    if not isinstance(settings, dict) or set(settings) != set(sizes):
        raise ValueError("no noise model in the settings")
    parts: dict[str, np.ndarray] = {}
    for name, given in settings.items():
        size = sizes[name]
        try:
            value = parts[name] = np.asarray(given, dtype=float)
        except (TypeError, ValueError, OverflowError):
            raise ValueError(f"{name} of the noise model is damaged") from None
        if value.shape != (() if size is None else (size,)) or not np.isfinite(value).all():
            raise ValueError(f"{name} of the noise model is damaged")
    return parts
