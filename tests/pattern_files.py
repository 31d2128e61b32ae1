"""Adaptics patterns, for several tests."""

from skinwave.patterns.adaptics_file import FORMAT, REVISIONS

LINEAR, STEP = {"name": "linear", "params": {}}, {"name": "step", "params": {}}
ALONE = {"circle": {"radius": 10.0}, "line": {"length": 10.0, "thickness": 1.0, "rotation": 30.0}}


def f64(value):
    return {"type": "f64", "value": value}


def brush(name="circle", **numbers):
    numbers = ALONE.get(name, {}) | {"am_freq": 0.0, "stm_freq": 80.0} | numbers
    params = {k: v if isinstance(v, dict) else f64(v) for k, v in numbers.items()}
    return {"brush": {"name": name, "params": params}, "transition": LINEAR}


def keyframe(time, xy=(0.0, 0.0), drawn=None, intensity=1.0, transition=LINEAR):
    """A standard keyframe, or a pause where there is no place."""
    constant = {"name": "constant", "params": {"value": f64(intensity)}}
    frame = {
        "time": time,
        "type": "standard" if xy else "pause",
        "brush": drawn or brush(),
        "intensity": {"intensity": constant, "transition": transition},
        "cjumps": [],
    }
    if xy:
        place = {"x": xy[0], "y": xy[1], "z": 0.0}
        frame["coords"] = {"coords": place, "transition": transition}
    return frame


def stop(time):
    return {"time": time, "type": "stop"}


def jump(parameter, operator, value, to):
    condition = {"parameter": parameter, "operator": {"name": operator, "params": {}},
                 "value": value}  # fmt: skip
    return {"condition": condition, "jump_to": to}


def adaptics(*keyframes, revision=REVISIONS[-1], **transform):
    zero, one = f64(0.0), f64(1.0)
    simple = {
        "translate": {"x": zero, "y": zero, "z": f64(180.0)},
        "rotation": zero,
        "scale": {"x": one, "y": one, "z": one},
    }
    return {
        "$DATA_FORMAT": FORMAT,
        "$REVISION": revision,
        "name": "made",
        "keyframes": list(keyframes),
        "pattern_transform": {
            "geometric_transforms": simple, "intensity_factor": one, "playback_speed": one,
        } | transform,
        "user_parameter_definitions": {"size": {"default": 7.0, "min": 0, "max": 6.0, "step": 1}},
    }  # fmt: skip
