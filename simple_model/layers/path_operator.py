"""Steady lines of one load on many bodies: its path as a linear operator on the response of a body
to a focus at rest.

`flat_body.steady_lines` interpolates g(r, w) by splines B_j(r) between distances r_j. With the
values g_j(w) = g(r_j, w) the line at f = f_m + n f_d is, at a probe x_p,

    u(f) = c sum_j g_j(f) h_nj(x_p),   h_nj = int_0^1 B_j(|x_p - X(a)|) exp(-2 pi i n a) da

where h depends on the path and the probes alone.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simple_model.layers.compliance import Compliance
from simple_model.layers.flat_body import distance_table, radial_spline
from simple_model.layers.wavenumber_integral import point_response
from simple_model.load.focus import spot_width
from simple_model.load.path_cells import path_fourier, path_samples
from simple_model.load.pressure import MovingPressure, check_lines
from simple_model.load.spectrum import load_lines
from simple_model.typing import Complex, Floats

AT_ONCE = 2**20  # values of the splines, some ten megabytes


@dataclass(frozen=True, kw_only=True, eq=False)
class PathOperator:
    """Load of a path on some probes.

    Parameters
    ----------
    width : metre, standard deviation of the focal spot
    distances : (j,) float, metre
    frequencies : (f,) float, Hz, distinct
    lines : (l,) int, the frequency of each line
    orders : (l,) int, the harmonic of each line, an index of `harmonics`
    coefficients : (l,) complex, Pa
    harmonics : (n, p, j) complex, h of the distinct orders
    """

    width: float
    distances: Floats
    frequencies: Floats
    lines: NDArray[np.int_]
    orders: NDArray[np.int_]
    coefficients: Complex
    harmonics: Complex

    def steady_lines(self, compliance: Compliance) -> tuple[Floats, Complex]:
        """Frequencies (f,) in Hz and amplitudes (f, p) in metre on a body, as of
        `flat_body.steady_lines`.
        """
        omega = 2 * np.pi * self.frequencies
        g = point_response(compliance, self.distances, omega, self.width)
        found = np.zeros((len(g), self.harmonics.shape[1]), np.complex128)
        for order, harmonic in enumerate(self.harmonics):
            own = self.orders == order
            moved = self.coefficients[own, None] * (g[self.lines[own]] @ harmonic.T)
            np.add.at(found, self.lines[own], moved)
        return self.frequencies, found


def path_operator(
    pressure: MovingPressure, probes: ArrayLike, *, threshold: float = 1e-6
) -> PathOperator:
    """Operator of a load on probes, which may be a whole map.

    Parameters
    ----------
    pressure : MovingPressure, with a Gaussian focus
    probes : (p, 2) float, metre
    threshold : of the strongest line of the load; only its lines above this are computed

    Returns
    -------
    PathOperator

    Raises
    ------
    ValueError
        If the focus is not Gaussian, or its path recorded, or as `pressure.check_lines` does.
    """
    check_lines(pressure)
    if pressure.profile != "gaussian" or pressure.tacton.trajectory.shape == "recorded":
        raise ValueError(
            "the steady lines of a path need a Gaussian focus and a path that is repeated; take "
            "finite elements, or motion from rest"
        )
    load = load_lines(pressure, threshold)
    frequencies, lines = np.unique(np.round(load.frequencies, 9), return_inverse=True)
    distinct, orders = np.unique(load.harmonics, return_inverse=True)
    knots, width = path_samples(pressure), spot_width(pressure.height)
    places = np.atleast_2d(np.asarray(probes, np.float64))
    away = np.linalg.norm(places[:, None] - knots, axis=-1)
    table = distance_table(away.max(), width)
    splines = radial_spline(table, np.eye(len(table)))
    blocks = np.array_split(away, max(1, away.size * len(table) // AT_ONCE))
    parts = [path_fourier(pressure, splines(part).swapaxes(1, 2), distinct) for part in blocks]
    return PathOperator(
        width=width, distances=table, frequencies=frequencies, lines=lines, orders=orders,
        coefficients=load.coefficients,
        harmonics=np.ascontiguousarray(np.moveaxis(np.concatenate(parts), -1, 0)),
    )  # fmt: skip
