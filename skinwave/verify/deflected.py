"""References of large deflection: the elastica, and von Karman's circular plate."""

import numpy as np
from scipy.integrate import solve_bvp, solve_ivp
from scipy.optimize import brentq

from skinwave.verify.references import Floats


def elastica(load: float) -> tuple[float, float]:
    """Deflection and shortening of a cantilever's tip over its length, at load = P L^2 / E I.

    theta'' = -load cos(theta), theta(0) = 0, theta'(1) = 0, integrated from the end with the slope
    that makes it clamped: Bisshopp and Drucker, Q Appl Math 3:272 (1945). Mattiasson, Int J Numer
    Methods Eng 17:145 (1981), has 0.30172 and 0.05643 at 1.
    """

    def bent(tip: float) -> Floats:
        def slope(s: float, y: Floats) -> list[float]:
            return [y[1], -load * np.cos(y[0]), np.sin(y[0]), np.cos(y[0])]

        return solve_ivp(slope, (1, 0), [tip, 0, 0, 0], rtol=1e-11, atol=1e-12).y[:, -1]

    end = bent(brentq(lambda tip: bent(tip)[0], 1e-9, np.pi / 2, xtol=1e-13))
    return -float(end[2]), 1 + float(end[3])


def karman_disc(load: float, poisson: float) -> float:
    """Central w / h of a clamped disc with an immovable edge, at q a^4 / 64 D h = load.

    Slope r g and force N a^2 / D of the radius r / a, deflection in thicknesses:
    g'' + 3 g' / r = N g + 32 load, N'' + 3 N' / r = -6 (1 - nu^2) g^2.
    Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells (1959), chapter 13.
    """

    def slopes(r: Floats, y: Floats) -> Floats:
        g, dg, N, dN, _ = y
        return np.vstack([dg, N * g + 32 * load, dN, -6 * (1 - poisson**2) * g**2, r * g])

    def ends(a: Floats, b: Floats) -> Floats:
        return np.array([a[1], a[3], b[0], b[3] + (1 - poisson) * b[2], b[4]])

    r = np.linspace(0, 1, 101)
    start = np.zeros((5, len(r)))
    start[0], start[4] = -4 * (1 - r**2), (1 - r**2) ** 2
    singular = np.diag([0.0, -3, 0, -3, 0])
    found = solve_bvp(slopes, ends, r, start, S=singular, tol=1e-6, max_nodes=20_000)
    if found.status:
        raise ArithmeticError(f"von Karman's equations were not solved: {found.message}")
    return float(found.y[4, 0])
