"""No body: what the point kernel acts on."""

from skinwave.bodies.body import Body, BodyKind, register


def _no_wave(body: Body, frequency: float) -> float:
    raise ValueError("body kind 'none' carries no wave; choose a sheet or a slab")


NONE = register(
    BodyKind(
        name="none",
        presets={"none": {}},
        words=lambda body: "none",
        wave_speed=_no_wave,
        is_bounded=False,
        may_be_layered=False,
    )
)
