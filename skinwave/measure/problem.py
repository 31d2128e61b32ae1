"""Problem of a fit: weighted residuals over the unit cube of its parameters, and their slopes."""

from dataclasses import dataclass, replace

import numpy as np

from meshes.tetmesh import Floats
from skinwave.measure.observed import Data
from skinwave.measure.parameters import Parameters

FORWARD, CENTRAL = 1e-5, 1e-3  # steps of differences, of the unit interval


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """Problem of a fit: parameters, data, and the keys that the model is in proportion to."""

    parameters: Parameters
    data: Data
    linear: tuple[str, ...]

    def residual(self, u: Floats) -> Floats:
        """Weighted residual (n s,) at a point u (k,) of the unit cube."""
        return self.data.weighted(self.predicted(u) - self.data.values).ravel()

    def predicted(self, u: Floats) -> Floats:
        """Prediction (n, s)."""
        return self.data.predict(self.parameters.values(u))

    def slopes(self, u: Floats, step: float = CENTRAL) -> Floats:
        """Derivatives (n s, k) of the residual, by central differences within the limits."""
        columns = []
        for k in range(len(u)):
            ends = np.clip([u[k] - step, u[k] + step], 0, 1)
            low, high = (np.where(np.arange(len(u)) == k, end, u) for end in ends)
            columns.append((self.residual(high) - self.residual(low)) / (ends[1] - ends[0]))
        return np.array(columns).T

    def forward(self, u: Floats) -> Floats:
        """Derivatives (n s, k) of the residual, by differences towards the middle."""
        at = self.residual(u)
        steps = np.where(u < 0.5, FORWARD, -FORWARD)
        each = (self.residual(u + moved) for moved in np.diag(steps))
        return np.array([(moved - at) / step for moved, step in zip(each, steps, strict=True)]).T

    @property
    def turned(self) -> "Problem":
        """The problem of a measurement with its sign turned."""
        return replace(self, data=replace(self.data, values=-self.data.values))

    @property
    def rough(self) -> "Problem":
        """The problem of the rough data, if there are any."""
        return replace(self, data=self.data.rough) if self.data.rough else self
