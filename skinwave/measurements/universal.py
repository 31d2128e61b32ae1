"""Universal File Format 58, functions at nodal degrees of freedom, by pyuff.

Each set is a place and, of several at one place, a repetition. Coordinates are those of the sets 15
or 2411 in the same file, lengths in the unit of set 164.
"""

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from meshes import reading
from simple_model.trajectory import Floats
from skinwave.measurements import units
from skinwave.measurements.recording import Given, Recording, nowhere

LARGEST = 1_000_000_000  # bytes
MISSING = 'files of Universal File Format 58 need pyuff; pip install "skinwave[measure]"'
FUNCTION, NODES, LENGTH_UNIT = 58, (15, 2411), 164
KINDS = {8: "displacement", 11: "velocity", 12: "acceleration"}
TIME, FREQUENCY = 17, 18
# Types of functions: of time, complex ones of frequency, and those without a phase.
IN_TIME, IN_FREQUENCY = (1,), (4, 12)
GENERAL = 0
TAG = re.compile(rb"    -1(?=[\r\n]|\Z| {74})")  # line before and after each set
NORMAL = 3  # along z, out of the body, the way a vibrometer above it looks


def read(path: Path, given: Given) -> Recording:
    """The recording in a file of Universal File Format.

    Raises
    ------
    ValueError
        If it is none, has no set 58 of normal motion, or its sets do not fit together.
    """
    found = _sets(path)
    functions = [one for one in found if one.get("type") == FUNCTION]
    if not functions:
        kinds = ", ".join(sorted({str(one.get("type")) for one in found})) or "none"
        raise ValueError(f"the file has no set 58, but {kinds}; export functions of time")
    motion = [one for one in functions if _is_motion(one)]
    if not motion:
        raise ValueError(_no_motion(functions))
    _alike(motion)
    motion, sign = _along_z(motion)
    groups = _by_node(motion)
    values = np.array([[one["data"] for one in group] for group in groups.values()])
    first = motion[0]
    in_time = _is_in_time(first)
    axis = units.in_si(np.asarray(first["x"], float), _per_axis(first, in_time))
    drive = _drive(functions, first)
    kind, unit, said = _unit(first, _per_metre(found))
    return Recording(
        values=np.moveaxis(values, 0, 2), times=axis if in_time else np.empty(0),
        frequencies=np.empty(0) if in_time else axis, quantity=kind, unit=unit,
        places=_places(found, list(groups)), sign=sign,
        drive=drive, name=_text(first, "id1"), remarks=tuple(said),
    )  # fmt: skip


def _sets(path: Path) -> list[dict[str, Any]]:
    try:
        import pyuff
    except ImportError:
        raise ValueError(MISSING) from None
    with reading.opened(path, LARGEST) as content:
        if len(TAG.findall(content.read())) % 2:
            raise ValueError("the file ends within a set, so that data are missing; export it anew")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            file = pyuff.UFF(str(path))
            kept = {FUNCTION, *NODES, LENGTH_UNIT}
            which = [k for k, kind in enumerate(file.get_set_types()) if int(kind) in kept]
            found = [file.read_sets(k) for k in which]
    except Exception as error:  # pyuff raises plain ones
        said = " ".join(str(error).split())[:80]
        raise ValueError(f"no Universal File that can be read ({said}); export it anew") from None
    if not found:
        raise ValueError("the file has no set 58 between lines of -1; export it anew")
    return [_cut(one) if one.get("type") == FUNCTION else one for one in found]


def _cut(one: dict[str, Any]) -> dict[str, Any]:
    """A set with as many values as its header tells; bytes of line ends may follow these."""
    count, data = int(one.get("num_pts", 0)), np.asarray(one.get("data", ()))
    if count < 2 or len(data) < count:
        raise ValueError(
            f"a set 58 has {len(data)} values, and its header tells of {count}; export it anew"
        )
    return one | {"data": data[:count], "x": np.asarray(one["x"])[:count]}


def _is_motion(one: dict[str, Any]) -> bool:
    """Whether a set is of normal or of undirected motion, with phase."""
    has_phase = one.get("func_type") in (GENERAL, *IN_TIME, *IN_FREQUENCY)
    return _is_of_motion(one) and has_phase and abs(int(one.get("rsp_dir", 0))) in (0, NORMAL)


def _is_of_motion(one: dict[str, Any]) -> bool:
    """Whether a set is of displacement, velocity or acceleration by its type or its unit."""
    said = _text(one, "ordinate_axis_units_lab").removesuffix("/N")
    return one.get("ordinate_spec_data_type", 0) in KINDS or units.quantity_of(said) != ""


def _no_motion(functions: list[dict[str, Any]]) -> str:
    first = functions[0]
    if first.get("func_type") not in (GENERAL, *IN_TIME, *IN_FREQUENCY):
        return (
            f"its functions are of type {first.get('func_type')}, which has no phase; export time "
            "responses (1), frequency responses (4) or spectra (12)"
        )
    directions = sorted({int(one.get("rsp_dir", 0)) for one in functions})
    return (
        f"none of its {len(functions)} functions is of displacement, velocity or acceleration "
        f"along z; their directions are {', '.join(map(str, directions))[:60]}"
    )


def _is_in_time(one: dict[str, Any]) -> bool:
    kind = one.get("abscissa_spec_data_type", 0)
    if kind in (TIME, FREQUENCY):
        return bool(kind == TIME)
    return one.get("func_type") in IN_TIME


def _per_axis(one: dict[str, Any], in_time: bool) -> float:
    """Divisor of the unit of the abscissa, SI if it has none."""
    said = _text(one, "abscissa_axis_units_lab")
    known, what = (units.TIMES, "time") if in_time else (units.FREQUENCIES, "frequency")
    return units.scale(said, known, what) if said else 1.0


def _alike(motion: list[dict[str, Any]]) -> None:
    """Refuse sets that differ in what they are of, or in their times or frequencies."""
    first = motion[0]
    for one in motion[1:]:
        if len(one["data"]) != len(first["data"]) or not np.allclose(one["x"], first["x"]):
            raise ValueError(
                f"sets 58 have {len(first['data'])} and {len(one['data'])} times or frequencies, "
                "or other ones; export them with the same"
            )
        for key in ("ordinate_spec_data_type", "ordinate_axis_units_lab", "func_type"):
            if one.get(key) != first.get(key):
                raise ValueError(
                    f"sets 58 differ in {key}: {str(first.get(key))[:20]}, "
                    f"{str(one.get(key))[:20]}; export one quantity"
                )


def _by_node(motion: list[dict[str, Any]]) -> dict[int, list[dict[str, Any]]]:
    """Sets by the number of their node; each has the same number of them."""
    groups: dict[int, list[dict[str, Any]]] = {}
    for one in motion:
        groups.setdefault(int(one.get("rsp_node", 0)), []).append(one)
    if len(groups) == 1 and len({_text(one, "rsp_ent_name") for one in motion}) > 1:
        groups = {k: [one] for k, one in enumerate(motion)}
    counts = {len(group) for group in groups.values()}
    if len(counts) > 1:
        raise ValueError(
            f"nodes have {min(counts)} to {max(counts)} sets 58; export as many of each"
        )
    return groups


def _along_z(motion: list[dict[str, Any]]) -> tuple[list[dict[str, Any]], int]:
    """Sets with those along -z turned, and the sign of z, -1, or 0 if they have no direction."""
    signs = [int(np.sign(int(one.get("rsp_dir", 0)))) for one in motion]
    if 0 in signs and any(signs):
        raise ValueError("some sets 58 have a direction and others none; export one kind")
    if 0 in signs:
        return motion, 0
    turned = zip(motion, signs, strict=True)
    return [one | {"data": sign * one["data"]} for one, sign in turned], -1


def _unit(one: dict[str, Any], per: float) -> tuple[str, str, list[str]]:
    """Quantity and unit of the ordinate, of the file's unit of length if it has none, and what was
    assumed.
    """
    said = _text(one, "ordinate_axis_units_lab").removesuffix("/N")
    kind = KINDS.get(int(one.get("ordinate_spec_data_type", 0)), "") or units.quantity_of(said)
    remarks = []
    if one.get("func_type") == IN_FREQUENCY[0]:
        remarks.append("frequency responses: values are per unit of the reference")
    if not said:
        said = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s2"}[kind]
        said = f"{1 / per!r} {said}"
        remarks.append(f"the unit is not in the file, {said} is assumed; --unit replaces it")
    return kind, said, remarks


def _per_metre(found: list[dict[str, Any]]) -> float:
    """Number of units of length of the file in a metre."""
    told = [float(one.get("length", 1.0)) for one in found if one.get("type") == LENGTH_UNIT]
    return told[0] if told and 0 < told[0] < np.inf else 1.0


def _drive(functions: list[dict[str, Any]], first: dict[str, Any]) -> np.ndarray:
    """The only function that is not of motion along any axis and has as many values."""
    found = [
        one["data"] for one in functions
        if not _is_of_motion(one) and len(one["data"]) == len(first["data"])
        and one.get("func_type") == first.get("func_type")
    ]  # fmt: skip
    return np.asarray(found[0]) if len(found) == 1 else np.empty(0)


def _places(found: list[dict[str, Any]], nodes: list[int]) -> Floats:
    """Places (p, 2) in metre of nodes; nan where there are no coordinates."""
    at: dict[int, tuple[float, float]] = {}
    for one in found:
        if one.get("type") in NODES:
            rows = zip(one["node_nums"], one["x"], one["y"], strict=False)
            at |= {int(node): (float(x), float(y)) for node, x, y in rows}
    if not set(nodes) <= at.keys():
        return nowhere(len(nodes))
    return np.array([at[node] for node in nodes]) / _per_metre(found)


def _text(one: dict[str, Any], key: str) -> str:
    said = str(one.get(key, "")).strip()
    return "" if said.upper() == "NONE" else said
