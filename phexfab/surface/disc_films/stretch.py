"""Smooth increasing maps that move samples to where a film's boundary needs them.

On a long or lobed rim the disc's uniform samples leave whole lobes out: an arc of the circle that
belongs to a lobe of length l and width b is as short as e^(−πl/b). So the samples' places follow
the film: halfway between uniform on the circle and uniform on the rim. The logarithm of the
density is a short Fourier series, so that the map is smooth, increasing, and its slope exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator, make_interp_spline

FloatArray = NDArray[np.float64]
FINE = 2048


@dataclass(frozen=True, eq=False)
class Stretch:
    """An increasing map of [0, 1] to itself.

    Attributes
    ----------
    waves : (FINE/2 + 1,) complex
        Fourier coefficients of the slope, of period 1, or of its even continuation, of period 2.
    period : int
    """

    waves: NDArray[np.complex128]
    period: int

    def __call__(self, tau: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return places and slopes."""
        last = int(np.flatnonzero(np.abs(self.waves) > 1e-16 * np.abs(self.waves[0])).max())
        k = np.arange(1, last + 1)
        turn = 2j * np.pi * k / self.period
        factor = 2 * self.waves[1 : last + 1]
        phase = np.exp(tau[:, None] * turn)
        mean = self.waves[0].real
        place = mean * tau + ((phase - 1) @ (factor / turn)).real if last else mean * tau
        return place, mean + (phase @ factor).real

    def inverse(self, place: FloatArray) -> FloatArray:
        """Return the tau (period 1) of places in [0, 1], to about 1e-13."""
        turn = 2j * np.pi * np.arange(1, len(self.waves))
        waves = np.append(0.0, self.waves[1:] / turn) * FINE
        fine = np.arange(FINE) / FINE
        known = self.waves[0].real * fine + np.fft.irfft(waves, FINE)
        known -= known[0]
        around = slice(-16, None), slice(None), slice(0, 17)
        table = np.concatenate(
            [known[part] + k for part, k in zip(around, (-1, 0, 1), strict=True)]
        )
        tau = np.concatenate([fine[part] + k for part, k in zip(around, (-1, 0, 1), strict=True)])
        return np.asarray(make_interp_spline(table, tau, k=7)(place))


def stretch_between(place: FloatArray, along: FloatArray, modes: float, periodic: bool) -> Stretch:
    """Return the stretch under which ``place`` and ``along`` are equally uniform.

    Parameters
    ----------
    place, along : (n + 1,)
        Increasing from 0 to 1 (periodic: by 1).
    modes : float
        Number of waves of the logarithm of the density.
    """
    mean = (place + 2 * along) / 3
    if periodic:
        mean, place = (np.concatenate([v[:-1] - 1, v, v[1:] + 1]) for v in (mean, place))
    period = 1 if periodic else 2
    fine = period * np.arange(FINE) / FINE
    folded = fine if periodic else 1 - np.abs(1 - fine)
    slope = PchipInterpolator(mean, place).derivative()(folded)
    waves = np.fft.rfft(np.log(np.maximum(slope, 1e-12)))
    k = np.arange(len(waves))
    waves *= np.exp(-((k / modes) ** 4))
    density = np.exp(np.fft.irfft(waves, FINE))
    found = np.fft.rfft(density) / FINE
    return Stretch(found / found[0].real, period)
