"""Published values that models are compared with: each set with conditions, spread and source.

`how` says whether a number was read in the source or where it is quoted, in the abstract only, or
computed from what the source gives. `built` names the presets that were fitted to a source or
chosen by it: there agreement is no evidence. All others predict it.
"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

ABSTRACT = "seen in the abstract only"
QUOTED = "read where another source quotes it"
COMPUTED = "computed from the source's numbers"
MODAL_HAND = "github.com/dusting28/Project_ModalHand"
ZHANG = "Zhang et al., Med Eng Phys 33:31 (2011), doi 10.1016/j.medengphy.2010.08.016"
MANFREDI = "Manfredi et al., PLoS ONE 7:e31203 (2012), doi 10.1371/journal.pone.0031203"
SKIN_DENSITY = 1000.0  # kg/m3
RAYLEIGH = 0.955313  # speed of the Rayleigh wave over that of shear waves, nu = 0.5


@dataclass(frozen=True)
class Quantity:
    """Quantity that sources publish: its name, unit on pages, and that unit in SI."""

    name: str
    unit: str
    size: float = 1.0


SPEED = Quantity("phase speed", "m/s")
LENGTH = Quantity("1/e length", "mm", 1e-3)
EXPONENT = Quantity("decay exponent", "")
FOCUS_SPEED = Quantity("speed of the focus", "m/s")


@dataclass(frozen=True, kw_only=True)
class Published:
    """Published values of one quantity.

    Parameters
    ----------
    frequencies : (n,) float, Hz; nan of a value at no frequency
    values : (n,) float, SI; nan where only a range is published
    lows, highs : (n,) float, SI, of people, or a standard deviation about the value; () if no
        spread is published
    how : how surely the numbers are known
    bodies : names of `predictions.BODIES` that are compared with it
    built : those of them that were made from it
    remark : what contradicts it, or was assumed
    """

    name: str
    site: str
    quantity: Quantity
    frequencies: tuple[float, ...]
    values: tuple[float, ...]
    lows: tuple[float, ...] = ()
    highs: tuple[float, ...] = ()
    conditions: str
    source: str
    how: str
    bodies: tuple[str, ...]
    built: tuple[str, ...] = ()
    remark: str = ""

    def between(self, k: int) -> tuple[float, float]:
        """Lowest and highest value, SI, at one of its frequencies."""
        return (self.lows[k], self.highs[k]) if self.lows else (self.values[k], self.values[k])

    def at(self, frequency: float) -> tuple[float, float] | None:
        """The same at a frequency in Hz, None if the source does not have it."""
        known = np.flatnonzero(np.isclose(self.frequencies, frequency))
        return self.between(int(known[0])) if len(known) else None


def rayleigh_wave(modulus: float, viscosity: float, frequency: float) -> tuple[float, float]:
    """Phase speed in m/s and 1/e length in m of Rayleigh's wave in an incompressible solid of
    Kelvin-Voigt's law: k = w sqrt(rho/(mu1 + i w mu2)) / 0.9553.
    """
    w = 2 * np.pi * frequency
    k = w * np.sqrt(SKIN_DENSITY / (modulus + 1j * w * viscosity)) / RAYLEIGH
    return float(w / k.real), float(1 / abs(k.imag))


_GRID = (0.0, 100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0)
_HANDS = ("palm", "palm-stiff", "palm-layers")
_ARMS = ("forearm", "forearm-layers")
_BACK = (
    "No preset is of the back of a hand: it is hairy skin on bone and tendons, and is compared "
    "with the forearm's and the palm's"
)
_DIGITISED = f"digitised in {MODAL_HAND}, waveAdmittance.m, which keeps its value at 700 Hz above"
_POTTS = Published(
    name="Potts: speed", site="back of the hand", quantity=SPEED, frequencies=_GRID,
    values=(6, 8, 9, 9, 10, 11, 11, 8), conditions="shear wave in vivo",
    source=f"Potts et al. (1983-84), {_DIGITISED}", how=QUOTED,
    bodies=(*_ARMS, "palm", "palm-layers"), built=("palm-layers",), remark=_BACK,
)  # fmt: skip
_FINGER = Published(
    name="Manfredi: speed, digitised", site="finger", quantity=SPEED, frequencies=_GRID,
    values=(18, 18, 10, 7.5, 5, 6, 7.5, 8), conditions="waves along the finger",
    source=f"{MANFREDI}, {_DIGITISED}", how=QUOTED, bodies=_HANDS, built=("palm-layers",),
    remark="Contradicts the abstract of the same paper, by which the speed rises with frequency to "
    "a plateau of 7 m/s",
)  # fmt: skip
_PLATEAU = Published(
    name="Manfredi: speed, abstract", site="finger", quantity=SPEED, frequencies=(300.0,),
    values=(7,), conditions="plateau of the speed; at 300 Hz, as the abstract names no frequency",
    source=MANFREDI, how=ABSTRACT, bodies=_HANDS,
    built=("palm-stiff", "palm-layers"),
    remark="Contradicts the values digitised from the same paper, which fall from 18 to 5 m/s",
)  # fmt: skip
VOIGT = (7.86e3, 1.86e3), (5.03, 0.60)  # Pa, Pa s, mean and standard deviation
_VOIGT_AT = (100.0, 200.0, 300.0, 400.0)
_ZHANG = Published(
    name="Zhang: speed", site="forearm", quantity=SPEED, frequencies=(200.0,), values=(3.25,),
    lows=(3.06,), highs=(3.44,), conditions="surface wave in vivo, mean +- standard deviation",
    source=ZHANG, how=ABSTRACT, bodies=_ARMS,
    built=("forearm", "forearm-layers"),
)  # fmt: skip
_ATTENUATION = (0.047, 0.050, 0.056, 0.062, 0.073, 0.082)  # 1/mm
_ZHANG_DIGITISED = Published(
    name="Zhang: 1/e length, digitised", site="forearm", quantity=LENGTH,
    frequencies=(100.0, 150.0, 200.0, 250.0, 300.0, 350.0),
    values=tuple(1e-3 / a for a in _ATTENUATION), conditions="attenuation of a surface wave",
    source=f"Zhang, digitised in {MODAL_HAND}, ShearWaveDecay.m, which does not say from which of "
    "Zhang's papers, nor from which site", how=QUOTED, bodies=_ARMS,
    remark="Longer by a factor of 2.4 at 200 Hz than Voigt's law gives with Zhang's constants",
)  # fmt: skip
_POTTS_LENGTH = replace(
    _POTTS, name="Potts: 1/e length", quantity=LENGTH,
    values=tuple(1e-3 * x for x in (11, 10, 9, 6, 4, 3, 3, 3)),
)  # fmt: skip
_MANFREDI_EXPONENT = replace(
    _FINGER, name="Manfredi: decay exponent", quantity=EXPONENT, frequencies=_GRID[1:],
    values=(1.15, 1.1, 1.15, 1.25, 1.15, 1.2, 1.25),
    conditions="amplitude ~ distance^-n; ours is fitted from 10 to 40 mm of a focal spot, which is "
    "assumed",
    remark="The file has no distances, and a wave with loss follows no power law: n depends on "
    "where it is fitted",
)  # fmt: skip
SKINSOURCE = Published(
    name="SkinSource: 1/e length", site="finger to wrist", quantity=LENGTH,
    frequencies=(50.0, 100.0, 200.0, 300.0, 400.0), values=(np.nan,) * 5,
    lows=tuple(1e-3 * x for x in (49, 47, 42, 35, 34)),
    highs=tuple(1e-3 * x for x in (105, 83, 81, 52, 49)),
    conditions="normal acceleration along the dorsal line away from the tip of digit III, force of "
    "a shaker there; four people",
    source="Tummala et al. (2024), doi 10.1109/HAPTICS59260.2024.10520852, data by doi "
    "10.5281/zenodo.10547601", how=COMPUTED, bodies=_HANDS, built=("palm-layers",),
    remark="Below 200 Hz the amplitude is not monotone, the finger moves as a linkage; our bodies "
    "have no joints and no dorsal side, and their length is that of a plane wave",
)  # fmt: skip
OPTIMUM = Published(
    name="Frier: optimum", site="palm", quantity=FOCUS_SPEED,
    frequencies=(np.nan,), values=(np.nan,), lows=(5.0,), highs=(8.0,),
    conditions="circling focus, vibrometer and user study: the optimum is a speed, that of surface "
    "waves", source="Frier et al., EuroHaptics 2018, doi 10.1007/978-3-319-93445-7_24",
    how=f"{ABSTRACT}; the range of 5 to 8 m/s is second-hand and was not checked",
    bodies=("palm", "palm-stiff", "skin-slab", "palm-layers"),
    built=("palm", "palm-stiff"),
    remark="palm and palm-stiff were chosen so that a half-space has its optimum near 5 and 7 m/s; "
    "that a slab of palm has it, too, was not",
)  # fmt: skip


def voigt_lengths() -> Published:
    """1/e lengths that Zhang's constants give, with the spread of the two."""
    ends = list(product(*((mean - spread, mean + spread) for mean, spread in VOIGT)))
    spread = [[rayleigh_wave(mu, eta, f)[1] for mu, eta in ends] for f in _VOIGT_AT]
    return replace(
        _ZHANG, name="Zhang: 1/e length by Voigt's law", quantity=LENGTH, frequencies=_VOIGT_AT,
        values=tuple(rayleigh_wave(VOIGT[0][0], VOIGT[1][0], f)[1] for f in _VOIGT_AT),
        lows=tuple(map(min, spread)), highs=tuple(map(max, spread)), how=COMPUTED,
        conditions="from mu1 = 7.86 +- 1.86 kPa and mu2 = 5.03 +- 0.60 Pa s, fitted to speeds of "
        "100 to 400 Hz",
        remark="A loss that was inferred from the dispersion of speed, not measured as decay",
    )  # fmt: skip


def wave_sets() -> tuple[Published, ...]:
    """All published sets of waves: speeds, 1/e lengths and decay exponents by frequency."""
    return (_ZHANG, _POTTS, _FINGER, _PLATEAU, voigt_lengths(), _ZHANG_DIGITISED, _POTTS_LENGTH,
            SKINSOURCE, _MANFREDI_EXPONENT)  # fmt: skip


# Published and not compared, and why.
NOT_COMPARED = (
    ("Kirkpatrick et al. (2004), doi 10.1117/1.1803843", "Rayleigh wave of porcine skin, 3.0 m/s",
     "the abstract names no frequency, and no preset is of pigs"),
    ("Feng et al. (2022), forearm, Young's moduli 4 MPa, 40 kPa, 15 kPa",
     "moduli of layers by broadband Rayleigh waves",
     "forearm-layers has these moduli; the speeds that they were fitted to were not readable"),
    ("Aglyamov et al. (2015), PMC4472317", "motion of a two-layer gel under radiation pressure",
     "its figures were not readable, and the gel was probably under liquid"),
    ("Shah et al. (2019), Appl. Sci. 9:4329",
     "a motor on the forearm, detected at 40 mm above 150 Hz, below thresholds beyond 80 mm",
     "a motor in contact loads the skin; its force is not known"),
    ("Pitre et al. (2019), PMC7043857",
     "surface motion faster than the shear wave beside the source",
     "no number was readable"),
    ("dusting28/Project_ModalHand", "whole hand below 100 to 200 Hz: jointed rigid parts and waves",
     "every body here rests on a support, and none has joints: it cannot show this"),
    ("Dandu et al., in ShearWaveDecay.m of the same",
     "distance of half the energy, 89 to 24 mm from 40 to 640 Hz",
     "which energy, and within which part of the hand, the file does not say"),
    ("Reardon et al. (2023), doi 10.1126/sciadv.adf2037",
     "shear shock patterns that extend more than ten times as far as the focus",
     "how extent was defined was not readable"),
)  # fmt: skip


ALL = "All sources"  # begins the name of a set of them


def all_sources(quantity: Quantity) -> Published:
    """Lowest and highest value, whatever the site, of all sources of a quantity as one set, at the
    frequencies that two of them have or more.
    """
    sets = [each for each in wave_sets() if each.quantity is quantity]
    found = {f: [pair for each in sets if (pair := each.at(f))] for f in _GRID[1:]}
    shared = {f: pairs for f, pairs in found.items() if len(pairs) > 1}
    return Published(
        name=f"{ALL}: {quantity.name}", site="back of the hand, finger, forearm",
        quantity=quantity, frequencies=tuple(shared), values=(np.nan,) * len(shared),
        lows=tuple(min(low for low, _ in pairs) for pairs in shared.values()),
        highs=tuple(max(high for _, high in pairs) for pairs in shared.values()),
        conditions="lowest to highest of the sources here, where two or more have the frequency",
        source="the sets of this page", how=COMPUTED,
        bodies=("forearm", "palm", "palm-stiff", "skin-slab", "palm-layers", "forearm-layers"),
        remark="Sites and methods differ, so that this is wider than people are at one site; sets "
        "that presets were fitted to are among them",
    )  # fmt: skip
