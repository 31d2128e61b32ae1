"""What a scene requires and no more: model, element size, rates, cost, and a reason for each."""

from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from meshes.tetmesh import Floats
from simple_model.flat_body import AIR_DENSITY, steady_lines
from simple_model.focus import spot_width
from simple_model.steady import load_lines
from skinwave.bodies import SHEET_CELLS, compliance
from skinwave.scene import Scene

SAMPLE_RATE = 10_000.0  # Hz of every response: five times the highest line that matters
# Hz of the load given to the reduced model: linear between two samples, its lines at 200 Hz
# come out 0.03 % low, at 600 Hz 0.3 %.
LOAD_RATE = 20_000.0
TRANSIENT_RATE = 20_000.0  # Hz of the full time stepping: 0.3 % at 600 Hz
BAND = 1000.0  # Hz up to which the reduced model must be right
REDUCTION_TOLERANCE = 1e-3

# Waveform errors measured on the default bodies against finer meshes, over six of the paper's
# Tactons: slabs 2.4 % at 0.69 of the length scale below; sheets 0.9 % at 60 cells a side, and up
# to eight times that where f_AM meets a resonance.
SLAB_ERROR, SLAB_SIZE, SLAB_ORDER = 0.024, 0.69, 3.3
SHEET_ERROR, SHEET_ORDER = 0.009, 2.4
# One reduction at 78 k unknowns on two cores: s and bytes, and how they grow.
REFERENCE_DOFS, REFERENCE_SECONDS, REFERENCE_BYTES, GROWTH = 78e3, 14.0, 1.0e9, 1.3


@dataclass(frozen=True, kw_only=True)
class Row:
    """One thing that was decided, and why."""

    what: str
    value: str
    reason: str


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What to run: `model`, element size `h` in metre (None without a mesh), the highest line in
    Hz that matters, predicted seconds and bytes of the first answer, and the reasons.
    """

    model: str
    h: float | None
    highest: float
    seconds: float
    memory: float
    rows: tuple[Row, ...]


def plan(scene: Scene, tolerance: float = 0.05) -> Plan:
    """What answers a scene within a relative error of `tolerance` in its probes' waveforms.

    Raises
    ------
    ValueError
        If the tolerance is not between 0 and 1.
    """
    if not 0 < tolerance < 1:
        raise ValueError(f"tolerance = {tolerance} is outside 0 < tolerance < 1")
    if scene.body.kind == "none":
        model = Row(what="model", value="point-kernel", reason="there is no body to move")
        return Plan(model="point-kernel", h=None, highest=0, seconds=0.1, memory=1e8, rows=(model,))
    highest, lines = _highest_line(scene, tolerance)
    rows = [
        Row(
            what="highest line",
            value=f"{highest:.0f} Hz",
            reason=f"of {lines} lines in the load; those above move the probes by less than "
            f"{100 * tolerance / 3:.2g} % of the whole",
        )
    ]
    if _is_endless(scene):
        rows += [
            Row(
                what="model",
                value="flat-body",
                reason="a homogeneous flat slab without sides that reflect: exact waves, no mesh",
            ),
            *_left_out(scene, highest),
        ]
        return Plan(
            model="flat-body", h=None, highest=highest, seconds=2.0, memory=3e8, rows=tuple(rows)
        )
    return _with_elements(scene, tolerance, highest, rows)


def _with_elements(scene: Scene, tolerance: float, highest: float, rows: list[Row]) -> Plan:
    h, dofs, reason = _element_size(scene, highest, tolerance)
    seconds = REFERENCE_SECONDS * (dofs / REFERENCE_DOFS) ** GROWTH
    memory = REFERENCE_BYTES * (dofs / REFERENCE_DOFS) ** GROWTH
    droop = (2 * np.pi * highest / LOAD_RATE) ** 2 / 12
    rows += [
        Row(what="model", value="fem", reason=_why_elements(scene)),
        Row(what="element size", value=f"{1e3 * h:.2f} mm, {dofs:,.0f} unknowns", reason=reason),
        Row(
            what="reduction",
            value=f"{min(REDUCTION_TOLERANCE, tolerance / 50):.1g} up to {BAND:.0f} Hz",
            reason="a fiftieth of the tolerance: it costs little",
        ),
        Row(
            what="load rate",
            value=f"{LOAD_RATE / 1e3:g} kHz",
            reason=f"linear between samples, {100 * droop:.2g} % off at the highest line",
        ),
        *_left_out(scene, highest),
        Row(
            what="cost",
            value=f"{seconds:.0f} s, {memory / 2**30:.1f} GiB",
            reason="first answer on two cores; 0.2 s for each further Tacton on the same body",
        ),
    ]
    return Plan(model="fem", h=h, highest=highest, seconds=seconds, memory=memory, rows=tuple(rows))


def _highest_line(scene: Scene, tolerance: float) -> tuple[float, int]:
    """The line above which the probes' motion is negligible, and how many lines there are."""
    body = scene.body
    if body.kind == "slab" and body.base != "clamped":
        lines = load_lines(scene.pressure, tolerance / 3)
        return float(lines.frequencies.max()), len(np.unique(lines.frequencies))
    pressure = scene.pressure
    if pressure.focus != "gaussian":  # of the same width; only which lines matter is asked
        pressure = replace(pressure, focus="gaussian")
    f, a = steady_lines(compliance(body), pressure, scene.probe_points, threshold=tolerance / 100)
    power = (np.abs(a) ** 2 * np.where(f > 0, 0.5, 1.0)[:, None]).sum(axis=1)
    above = np.sqrt(np.append(np.cumsum(power[::-1])[::-1][1:], 0.0) / max(power.sum(), 1e-300))
    return float(f[np.argmax(above <= tolerance / 3)]), len(f)


def _is_endless(scene: Scene) -> bool:
    body = scene.body
    return (
        body.kind == "slab"
        and body.sides == "absorbing"
        and (body.base == "clamped" or not isfinite(body.depth))
        and scene.pressure.focus == "gaussian"
    )


def _why_elements(scene: Scene) -> str:
    body = scene.body
    if scene.pressure.focus != "gaussian":
        return f"exact waves need a Gaussian focus, not '{scene.pressure.focus}'"
    return f"the {body.sides} sides of this {body.kind} reflect; exact waves are endless"


def _element_size(scene: Scene, highest: float, tolerance: float) -> tuple[float, float, str]:
    """Element size in metre, unknowns, and the reason."""
    body, width = scene.body, spot_width(scene.pressure.height)
    share = tolerance / 2  # the other half is for everything else
    if body.kind == "sheet":
        cells = SHEET_CELLS * max(0.5, (SHEET_ERROR / share) ** (1 / SHEET_ORDER))
        h = min(body.width, body.height) / cells
        counts = [2 * np.ceil(side / h) + 1 for side in (body.width, body.height)]
        return (
            h,
            9 * counts[0] * counts[1],
            (
                f"{cells:.0f} cells along the shorter side: {100 * share:.2g} % by the measured "
                "error law, off resonance"
            ),
        )
    wavelength = body.solid.shear_speed / max(highest, 1.0)
    scale = min(width, wavelength / np.pi)
    h = min(SLAB_SIZE * scale * (share / SLAB_ERROR) ** (1 / SLAB_ORDER), body.depth / 2)
    dofs = REFERENCE_DOFS * (3e-3 / h) ** 2.3 * body.width * body.height / 0.01
    which = "the focal spot" if scale == width else f"the wavelength at {highest:.0f} Hz"
    return h, dofs, f"{100 * share:.2g} % by the measured error law, set by {which}"


def _left_out(scene: Scene, highest: float) -> list[Row]:
    """What the model leaves out, with the estimate behind that."""
    body, solid = scene.body, scene.body.solid
    if body.kind != "sheet":
        return []
    stiffness = solid.young * body.depth**3 / 12 / (1 - solid.poisson**2)
    mass = solid.density * body.depth
    k = (mass * (2 * np.pi * max(highest / 2, 20.0)) ** 2 / stiffness) ** 0.25
    air = 2 * AIR_DENSITY / k / mass
    force = 2 * np.pi * spot_width(scene.pressure.height) ** 2 * _mean_gain(scene)
    sag = 0.0056 * force * min(body.width, body.height) ** 2 / stiffness / body.depth
    shift = 1 - 1 / np.sqrt(1 + air)
    return [
        Row(
            what="left out: air",
            value=f"+{100 * air:.0f} % mass",
            reason=f"2 rho_air/k at half the highest line would lower resonances by "
            f"{100 * shift:.1f} %: take the answer as that of a sheet in vacuum",
        ),
        Row(
            what="left out: stretching",
            value=f"sag {sag:.1f} thicknesses",
            reason="a linear sheet; a real one stiffens beyond about half a thickness"
            if sag > 0.5
            else "the mean deflection is small",
        ),
    ]


def _mean_gain(scene: Scene) -> float:
    gain: Floats = scene.pressure.gain(np.arange(2000) / 2000 * scene.tacton.duration)
    return float(abs(gain.mean()))
