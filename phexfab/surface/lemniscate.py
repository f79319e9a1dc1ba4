"""The lemniscate sine and its inverse for complex arguments: Scherk's curvature-line coordinates.

References
----------
DLMF 22.6, 22.8 (complex arguments of Jacobi's functions) and 19.25 (Carlson's forms).
"""

from __future__ import annotations

import numpy as np
from scipy.special import ellipj, elliprf

from phexfab.surface.holomorphic import ComplexArray

QUARTER = 1.3110287771460598  # ∫_0^1 dt / √(1 - t⁴)


def sl(w: ComplexArray) -> ComplexArray:
    """Return the lemniscate sine, sl' = √(1 - sl⁴); its poles are at QUARTER (±1 ± i)."""
    w = np.sqrt(2.0) * np.asarray(w, complex)
    s, c, d, _ = ellipj(w.real, 0.5)
    s1, c1, d1, _ = ellipj(w.imag, 0.5)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = (s * d1 + 1j * c * d * s1 * c1) / (d * c1 * d1 - 0.5j * s * c * s1)
    return ratio / np.sqrt(2.0)


def arcsl(z: ComplexArray) -> ComplexArray:
    """Return ∫_0^z dt / √(1 - t⁴); cuts run outward from the four roots of 1."""
    z = np.asarray(z, complex)
    return z * elliprf(1.0, 1 - z * z, 1 + z * z)
