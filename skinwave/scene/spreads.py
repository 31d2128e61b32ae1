"""Uncertain numbers of a scene, with the sources of their spreads.

A scene file may give a spread to any number. The presets of materials have the spread of their
sources, as factors on all moduli and on all losses. The pressure of a device is known to a factor
of 2, unless the file gives its spread (`spread = 0` for a measured pressure).

    preset                   moduli               losses
    palm, palm-stiff,        factor 2 [1]         factor 3 [2]
    palm-zener
    forearm                  24 % [3]             27 % [3]
    layers of skin           factor 3.2 [4]       factor 3 [2]
    paper                    factor 2 [5]         factor 1.6 [5]
    paper-grain              factor 1.6 [5]       factor 1.6 [5]
    ecoflex                  unknown, because its constants are second-hand
    bone                     none, because ten times its modulus moves a fingertip by 2 %

[1] No shear modulus of a palm in vivo is published. A moving focus feels strongest at 5 to 8 m/s
    (Frier et al., EuroHaptics 2018). Waves reach 7 m/s on fingers (Manfredi et al., PLoS ONE
    7:e31203 (2012)) and 3.25 m/s at 200 Hz on forearms (Zhang et al. 2011). c^2 thus spreads over
    a factor of 4, which is 2 on both sides of the preset.
[2] Decay lengths and loss factors of skin at 200 Hz differ by a factor of 5 to 9 between sources
    (Potts et al. 1983; Manfredi et al. 2012; Zhang et al. 2011), at most 3 on both sides.
[3] Zhang et al., Med Eng Phys 33:31 (2011): 7.86 +- 1.86 kPa and 5.03 +- 0.60 Pa s, whose ratio,
    the loss, has 27 % if the two errors are independent.
[4] Published moduli of a layer differ by a factor of 6 to 18 between methods and people. Speeds of
    waves on hands differ from fitted layers by 1.8, their squares by 3.2 (bench/layered_skin.py).
[5] Office paper has 5 to 8 GPa along and 2 to 4 GPa across the machine direction; "paper" has 4
    GPa, "paper-grain" 5.5 and 2.5 GPa. Its loss factor is 0.02 to 0.05.

Pressure: 160 dB at 200 mm are 59 Pa, or 28 Pa if that level is a peak value. Models of the array
give 59 to 87 Pa (Liebler et al., J Acoust Soc Am 148:1713 (2020); HandyBeam; AcousTools).
"""

from collections.abc import Mapping
from dataclasses import replace

from skinwave.scene.distributions import Distribution, Spread, within_factor
from skinwave.scene.dotted_keys import materials_of, value_at
from skinwave.scene.file import to_table
from skinwave.scene.keys import SCALES
from skinwave.scene.scene import Scene

PRESSURE = "focus.peak_pressure_pa"


# Distributions about 1 of the factors on all moduli, and on all losses, of a material.
OF_PRESETS: Mapping[str, tuple[Distribution, Distribution]] = {
    name: (moduli, losses)
    for names, moduli, losses in (
        ("palm palm-stiff palm-zener", within_factor(2.0), within_factor(3.0)),
        ("forearm", Distribution(width=(1.86 / 7.86,)), Distribution(width=(0.27,))),
        ("epidermis dermis fat muscle", within_factor(3.2), within_factor(3.0)),
        ("forearm-epidermis forearm-dermis forearm-hypodermis forearm-muscle",
         within_factor(3.2), within_factor(3.0)),
        ("paper", within_factor(2.0), within_factor(1.6)),
        ("paper-grain", within_factor(1.6), within_factor(1.6)),
    )
    for name in names.split()
}  # fmt: skip


def spreads_of(scene: Scene) -> tuple[Spread, ...]:
    """Return the uncertain numbers of a scene: those of its file, of presets, and the pressure."""
    table = to_table(replace(scene, spreads=())) if scene.spreads else {}
    spreads = [
        Spread(key=key, value=float(value), distribution=given)
        for key, given in scene.spreads
        if (value := value_at(table, key)) is not None
    ]
    device = scene.load.of_kind.is_of_device
    if device and PRESSURE not in dict(scene.spreads) and scene.pressure.peak_pressure > 0:
        spreads.append(
            Spread(key=PRESSURE, value=scene.pressure.peak_pressure,
                   distribution=within_factor(2.0), implied=True)
        )  # fmt: skip
    for key, material in materials_of(scene.body).items():
        known = OF_PRESETS.get(material, ()) if isinstance(material, str) else ()
        spreads += [Spread(key=f"{key}.{scale}", value=1.0, distribution=given, implied=True)
                    for scale, given in zip(SCALES, known, strict=False)]  # fmt: skip
    return tuple(each for each in spreads if not each.distribution.is_exact)
