"""Nearly constant loss factor: a causal law, as a short Prony series.

A modulus mu (1 + i eta) with one eta at all frequencies is not causal: loss comes with a storage
modulus that rises with frequency (Kramers and Kronig). The solid whose loss factor is eta at all
frequencies has the modulus

    mu(w) = mu (i w / w_0)^a / cos(pi a / 2),   a = (2 / pi) atan(eta)

(Kjartansson, J Geophys Res 84:4737 (1979), doi 10.1029/JB084iB09p04737). Its storage modulus is mu
at w_0, and 0 at rest. A few Maxwell branches with log-spaced times have the same modulus over a
band, and a modulus at rest (Liu, Anderson and Kanamori, Geophys J R Astron Soc 47:41 (1976), doi
10.1111/j.1365-246X.1976.tb01261.x; Emmerich and Korn, Geophysics 52:1252 (1987), doi
10.1190/1.1442386). They are the definition of a loss factor here, in every model alike:

- the storage modulus is mu at `REFERENCE`;
- the loss factor is eta within 2.5 % over `BAND`, up to eta = 2; within 10 % beyond. It falls below
  the band, to half of eta at 3 Hz, and to 0 at rest;
- the modulus at rest is 0.92, 0.76 and 0.35 mu for eta = 0.03, 0.1 and 0.4. A load from rest
  reaches it in some tens of ms.
"""

from functools import lru_cache

import numpy as np

from simple_model.layers.prony import PronySeries, fitted_series

REFERENCE = 150.0  # Hz, where the storage modulus is the one that is given
BAND = (10.0, 2000.0)  # Hz, where the loss factor is nearly constant
SLOWEST, FASTEST, TERMS = 8.0, 1600.0, 4  # Hz: 1 / (2 pi time); best for loss factors up to 2
LARGEST_LOSS_FACTOR = 10.0
FREQUENCIES = 93  # at which the series is fitted


@lru_cache(maxsize=1024)
def constant_loss(loss_factor: float) -> PronySeries:
    """Modulus of a nearly constant loss factor, relative to the storage modulus at `REFERENCE`.

    Parameters
    ----------
    loss_factor : float, above 0

    Returns
    -------
    PronySeries
        Without unit, and its viscosity in s.
    """
    w, w_0 = 2 * np.pi * np.geomspace(*BAND, FREQUENCIES), 2 * np.pi * REFERENCE
    power = 2 / np.pi * np.arctan(loss_factor)
    exact = (1j * w / w_0) ** power / np.cos(np.pi * power / 2)
    times = 1 / (2 * np.pi * np.geomspace(SLOWEST, FASTEST, TERMS))
    series = fitted_series(w, exact, times, None, BAND)
    return series.scaled(1 / float(series(w_0).real))
