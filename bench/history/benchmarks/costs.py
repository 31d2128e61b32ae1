"""CPU seconds of one thread of what every run is made of, and ratios that no machine changes much.

Seconds compare along the history of one machine only.
"""

import os
import subprocess
import sys
import time
import timeit

import numpy as np

os.environ["SKINWAVE_CACHE"] = ""  # every body is reduced anew

import fem
import meshes
from simple_model import MovingPressure, Tacton, Trajectory, flat_body, point_kernel
from simple_model.layers.compliance import slab
from simple_model.layers.material import PRESETS
from skinwave.models.prepared import answer, prepare
from skinwave.scene.scene import Body, Scene

LOAD = MovingPressure(
    tacton=Tacton(
        am_frequency=140, duration=0.2, trajectory=Trajectory(shape="circle", size=0.02, speed=12)
    )
)
PROBES = np.array([[0.0, 0.0], [0.01, 0.0]])
COARSE = 10e-3  # m, elements


class Costs:
    """Seconds of the process, which other work on the machine disturbs little."""

    timer = time.process_time
    number, repeat = 1, (2, 5, 20.0)

    def setup(self):
        self.times = np.arange(2000) / 1e4
        self.mesh = meshes.block((0.06, 0.06, 0.015), 5e-3)
        self.body, self.skin = Body(), slab(PRESETS["palm"], 0.015)
        self.scene = Scene(pressure=LOAD, body=self.body, probes=tuple(map(tuple, PROBES)))
        self.prepared = prepare(self.body, PROBES, h=COARSE)

    def time_point_kernel(self):
        point_kernel(LOAD, PROBES, self.times)

    time_point_kernel.number = 20

    def time_wavenumber_integral(self):
        flat_body(self.skin, LOAD, PROBES, self.times)

    def time_assembly(self):
        fem.assemble(self.mesh, PRESETS["palm"])

    def time_reduction(self):
        prepare(self.body, PROBES, h=COARSE)

    def time_one_more_tacton(self):
        answer(self.prepared, self.scene)


def track_point_kernel_over_exp():
    """Point kernel of a Gaussian focus over one exponential a sample."""
    times, points = np.arange(40_000) / 4e4, np.zeros((20, 2)) + 0.004
    plain = np.ones((len(times), len(points)))

    def best(run):
        return min(timeit.repeat(run, timer=time.process_time, number=1, repeat=5))

    return best(lambda: point_kernel(LOAD, points, times)) / best(lambda: np.exp(plain))


track_point_kernel_over_exp.unit = "times"


def track_import():
    """CPU seconds until `skinwave.simulate` is there over those of numpy and scipy alone."""

    def of(imports):
        told = f"import time\n{imports}\nprint(time.process_time())"
        return min(float(subprocess.check_output([sys.executable, "-c", told])) for _ in range(3))

    return of("from skinwave import simulate") / of("import numpy, scipy.sparse")


track_import.unit = "times"


def track_reduced_order():
    """Order of the reduced model of a coarse slab."""
    return prepare(Body(), PROBES, h=COARSE).body.damping.shape[0]


track_reduced_order.unit = "unknowns"
