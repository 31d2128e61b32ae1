"""Hints for unknown keys of a scene, with the conversion where the known key has another value."""

from collections.abc import Callable, Iterable
from math import isfinite, nan, pi, radians, tan
from typing import Any

from simple_model.choices import nearest

UNITS = {  # by the end of a key: kind of quantity, and unit in SI units
    end: (kind, unit)
    for kind, units in {
        "length": {"_m": 1.0, "_cm": 1e-2, "_mm": 1e-3, "_um": 1e-6, "_inch": 25.4e-3},
        "time": {"_s": 1.0, "_ms": 1e-3, "_us": 1e-6},
        "frequency": {"_hz": 1.0, "_khz": 1e3},
        "modulus": {"_pa": 1.0, "_kpa": 1e3, "_mpa": 1e6, "_gpa": 1e9},
        "viscosity": {"_pa_s": 1.0, "_kpa_s": 1e3, "_mpa_s": 1e-3, "_cp": 1e-3},  # m of milli
        "density": {"_kg_m3": 1.0, "_g_m3": 1e-3, "_g_cm3": 1e3, "_g_ml": 1e3},
        "speed": {"_m_per_s": 1.0, "_cm_per_s": 1e-2, "_mm_per_s": 1e-3, "_km_per_h": 1 / 3.6},
        "force": {"_n": 1.0, "_mn": 1e-3},
        "angle": {"_deg": radians(1), "_rad": 1.0},
        "grammage": {"_g_m2": 1e-3, "_kg_m2": 1.0},
    }.items()
    for end, unit in units.items()
}
AT = "at the frequency f in Hz that matters"
CONVERSIONS: tuple[tuple[str, str, str, Callable[[float], float]], ...] = (
    # other names without underscores, key, its value in words and as a function of the other one
    ("qualityfactor qfactor q qs", "loss_factor", "1 / Q", lambda q: 1 / q),
    ("dampingratio modaldamping zeta damping xi", "loss_factor", "2 zeta", lambda zeta: 2 * zeta),
    ("dampingpercent dampingratiopercent", "loss_factor", "2 zeta / 100", lambda x: x / 50),
    ("logdecrement logarithmicdecrement", "loss_factor", "decrement / pi", lambda d: d / pi),
    ("lossangledeg phaseangledeg", "loss_factor", "tan(angle)", lambda x: tan(radians(x))),
    ("losstangent tandelta tand eta", "loss_factor", "tan(delta)", lambda loss: loss),
    ("structuraldamping hystereticdamping", "loss_factor", "its value", lambda loss: loss),
    ("lossmodulus lossmoduluspa", "loss_factor", "loss modulus / shear modulus", lambda _: nan),
    ("alpha rayleighalpha massdamping", "loss_factor", f"alpha / (2 pi f) {AT}", lambda _: nan),
    ("beta rayleighbeta stiffnessdamping", "loss_factor", f"2 pi f beta {AT}", lambda _: nan),
    ("rayleigh rayleighdamping", "loss_factor", f"alpha / (2 pi f) + 2 pi f beta {AT}",
     lambda _: nan),
    ("radiusmm radius", "size_mm", "2 radius", lambda radius: 2 * radius),
    ("diametermm diameter", "size_mm", "diameter", lambda diameter: diameter),
    ("bulkmoduluspa bulkmodulus", "poisson", "(3 K - 2 G) / (6 K + 2 G)", lambda _: nan),
)  # fmt: skip


def key_hint(key: str, known: Iterable[str], value: Any = None) -> str:
    """Return the end of a sentence that names the nearest known key; "" if none is near.

    It gives the value to write if that is not the given one.
    """
    known = list(known)
    for names, other, words, of in CONVERSIONS:
        if key.lower().replace("_", "") in names.split() and other in known:
            return f"; write {other} = {words}{_result(of, value)}"
    near = nearest(key, known)
    factor = _units_between(key.lower(), near) * (0.5 if _is_diameter(key, near) else 1.0)
    if factor != 1:
        return f"; write {near} = {factor:g} x {key}{_result(lambda x: factor * x, value)}"
    return f"; did you mean '{near}'?" if near else ""


def _result(of: Callable[[float], float], value: Any) -> str:
    """Equals sign and number, if there is one."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not value:
        return ""
    number = of(value)
    return f" = {number:.6g}" if isfinite(number) else ""


def _units_between(key: str, near: str) -> float:
    """Unit of one key in that of another one; 1 if they are not of one kind."""
    ends = [max((e for e in UNITS if k.endswith(e)), key=len, default="") for k in (key, near)]
    kinds, units = zip(*(UNITS.get(end, ("", 1.0)) for end in ends), strict=True)
    return float(units[0] / units[1]) if kinds[0] == kinds[1] else 1.0


def _is_diameter(key: str, near: str) -> bool:
    return "diameter" in key.lower() and "radius" in near
