"""One problem in one file, so that every code reads the same mesh, material and load."""

from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np


def nothing() -> np.ndarray:
    return np.zeros(0)


@dataclass(kw_only=True)
class Problem:
    """A body of straight 10-node tetrahedra, with its constraints, loads and probes.

    `nodes` (n, 3) in metre, corners first; `cells` (m, 10) in VTK's order; `surface` (k, 3) the
    boundary's corners; `material` mu Pa, nu, rho kg/m3. Without `forces` it is only assembled.
    """

    nodes: np.ndarray
    cells: np.ndarray
    surface: np.ndarray
    material: np.ndarray
    fixed: np.ndarray = field(default_factory=nothing)  # (3 n,) bool, component fastest
    lag: np.ndarray = field(default_factory=nothing)  # s, damping C = lag K
    dt: np.ndarray = field(default_factory=nothing)  # s
    pushed: np.ndarray = field(default_factory=nothing)  # numbers of the pushed components
    forces: np.ndarray = field(default_factory=nothing)  # (steps + 1, pushed) in N
    probes: np.ndarray = field(default_factory=nothing)  # (p, 3 n): displacement at the probes

    @property
    def points(self) -> np.ndarray:
        """The corners, all that most codes take."""
        return self.nodes[: self.tets.max() + 1]

    @property
    def tets(self) -> np.ndarray:
        return self.cells[:, :4]

    @property
    def mu(self) -> float:
        return float(self.material[0])

    @property
    def nu(self) -> float:
        return float(self.material[1])

    @property
    def rho(self) -> float:
        return float(self.material[2])

    @property
    def lam(self) -> float:
        return 2 * self.mu * self.nu / (1 - 2 * self.nu)

    def save(self, path: Path) -> Path:
        np.savez(path, **{f.name: getattr(self, f.name) for f in fields(self)})
        return path


def load(path: str | Path) -> Problem:
    with np.load(path) as file:
        return Problem(**{name: file[name] for name in file.files})
