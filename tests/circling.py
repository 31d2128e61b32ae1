"""Loads of a focus on a circle, for several tests."""

import numpy as np

from simple_model import MovingPressure, Tacton, Trajectory


def circle(f_d, size=0.02):
    """A circle of a diameter in metre that is drawn f_d times a second."""
    return Trajectory(shape="circle", size=size, speed=size * np.pi * f_d)


def circling(size, speed, am=0.0, duration=1.0, **load):
    path = Trajectory(shape="circle", size=size, speed=speed)
    tacton = Tacton(am_frequency=am, trajectory=path, duration=duration)
    return MovingPressure(tacton=tacton, **{"peak_pressure": 1.0} | load)
