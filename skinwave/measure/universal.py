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
from simple_model.typing import Floats
from skinwave.measure import units
from skinwave.measure.recording import Given, Recording, nowhere
from skinwave.measure.references import ONE_AFTER_ANOTHER, aligned

LARGEST = 1_000_000_000  # bytes
MISSING = 'files of Universal File Format 58 need pyuff; pip install "skinwave[measure]"'
FUNCTION, NODES, LENGTH_UNIT = 58, (15, 2411), 164
KINDS = {8: "displacement", 11: "velocity", 12: "acceleration"}
HELD = {
    15: "nodes", 2411: "nodes", 2412: "elements", 18: "coordinate systems", 82: "lines",
    151: "header", 164: "units", 55: "shapes", 2414: "shapes", 2420: "coordinate systems",
}  # fmt: skip
TIME, FREQUENCY = 17, 18
# Types of functions: of time, complex ones of frequency, and those without a phase.
IN_TIME, IN_FREQUENCY = (1,), (4, 12)
GENERAL = 0
TAG = re.compile(rb"    -1(?=[\r\n]|\Z| {74})")  # line before and after each set
AXES = {"x": 1, "y": 2, "z": 3}  # z is out of the body, the way a vibrometer above it looks


def read(path: Path, given: Given) -> Recording:
    """The recording in a file of Universal File Format.

    Sets of a reference for each place bring the places into step; a single one is the drive.

    Raises
    ------
    ValueError
        If it is none, has no set 58 of motion along the direction, or its sets do not fit together.
    """
    found = _sets(path)
    functions = [one for one in found if one.get("type") == FUNCTION]
    motion, others = _motion(functions, given)
    first = motion[0]
    _alike(motion)
    motion, sign = _turned(motion)
    groups = _by_node(motion)
    in_time = _is_in_time(first)
    values = np.moveaxis(np.array([[one["data"] for one in group] for _, group in groups]), 0, 2)
    if not in_time and not np.iscomplexobj(values):
        raise ValueError("its spectra have no phase; export complex spectra or time responses")
    axis = units.in_si(np.asarray(first["x"], float), _per_axis(first, in_time))
    kind, unit, said = _unit(first, _per_metre(found), given)
    values, drive, more = _in_step(values, others, groups, in_time)
    if left_out := sum(abs(int(one.get("rsp_dir", 0))) not in (0, abs(int(first["rsp_dir"])))
                       for one in functions if _quantity(one)):  # fmt: skip
        more.append(f"{left_out} functions of other directions are left out")
    if len(groups) == 1 and len(motion) > 1:
        more.append(f"{len(motion)} sets of one node are taken as repetitions")
    return Recording(
        values=values, times=axis[: values.shape[1]] if in_time else np.empty(0),
        frequencies=np.empty(0) if in_time else axis, quantity=kind, unit=unit,
        places=_places(found, [node for node, _ in groups]), sign=sign,
        drive=drive, name=_text(first, "id1"), remarks=(*said, *more),
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
            kinds = [int(kind) for kind in file.get_set_types()]
            kept = {FUNCTION, *NODES, LENGTH_UNIT}
            found = [file.read_sets(k) for k, kind in enumerate(kinds) if kind in kept]
    except Exception:  # pyuff raises plain ones
        raise ValueError(
            "the file is damaged or no Universal File; export it anew, as text if it is binary"
        ) from None
    if FUNCTION not in kinds:
        held = ", ".join(f"{k} ({HELD.get(k, 'unknown')})" for k in sorted(set(kinds)))
        raise ValueError(
            f"the file has no set 58 of functions{f', but {held}' if held else ''}; export "
            "functions of time or frequency"
        )
    return [_cut(one) if one.get("type") == FUNCTION else one for one in found]


def _cut(one: dict[str, Any]) -> dict[str, Any]:
    """A set with as many values as its header tells; bytes of line ends may follow these."""
    count, data = int(one.get("num_pts", 0)), np.asarray(one.get("data", ()))
    if count < 2 or len(data) < count:
        raise ValueError(
            f"a set 58 has {len(data)} values, and its header tells of {count}; export it anew"
        )
    return one | {"data": data[:count], "x": np.asarray(one["x"])[:count]}


def _motion(
    functions: list[dict[str, Any]], given: Given
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Sets of motion with phase along the direction, and those of anything else."""
    with_phase = [one for one in functions
                  if one.get("func_type") in (GENERAL, *IN_TIME, *IN_FREQUENCY)]  # fmt: skip
    if not with_phase:
        raise ValueError(
            f"its functions are of type {functions[0].get('func_type')}, which has no phase; "
            "export time responses (1), frequency responses (4) or spectra (12)"
        )
    others = [one for one in with_phase if _is_reference(one)]
    sure = [one for one in with_phase if not _is_reference(one)]
    of = {_quantity(one) for one in sure} - {""}
    if not of and (given.unit or given.quantity):
        motion = sure
    else:
        wanted = given.quantity if given.quantity in of else ""
        motion = [one for one in sure if _quantity(one) in ({wanted} if wanted else of)]
        others += [one for one in sure if not _quantity(one)]
    along = AXES[given.direction or "z"]
    at = [one for one in motion if abs(int(one.get("rsp_dir", 0))) in (0, along)]
    nodes = {int(one.get("ref_node", 0)) for one in at}
    if len(nodes) > 1 and all(one.get("func_type") == IN_FREQUENCY[0] for one in at):
        raise ValueError(
            f"its frequency responses have {len(nodes)} references, the nodes "
            f"{', '.join(map(str, sorted(nodes)))}; export those of one"
        )
    if at:
        return at, others
    if not motion:
        kinds = sorted({_text(one, "ordinate_axis_units_lab") for one in with_phase} - {""})
        raise ValueError(
            f"none of its {len(functions)} functions is of displacement, velocity or acceleration"
            f"{', but in ' + ', '.join(kinds)[:60] if kinds else ''}; give --unit, such as "
            '"20 mm/s", if they are motion'
        )
    names = {number: name for name, number in AXES.items()}
    directions = {abs(int(one.get("rsp_dir", 0))) for one in motion}
    known = sorted(names.get(k, f"rotation {k}") for k in directions)
    raise ValueError(
        f"none of its {len(motion)} functions of motion is along {given.direction or 'z'}; their "
        f"directions are {', '.join(known)[:60]}; give --direction"
    )


def _is_reference(one: dict[str, Any]) -> bool:
    return any(re.match(r"ref(erence)?\d*\b", _text(one, key), re.I) for key in ("id1", "id2"))


def _quantity(one: dict[str, Any]) -> str:
    """Quantity of motion of a set by its type or its unit; "" if it is of none."""
    unit = units.per_reference(_text(one, "ordinate_axis_units_lab"))[0]
    return KINDS.get(int(one.get("ordinate_spec_data_type", 0)), "") or units.quantity_of(unit)


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
        step = 1e-3 * abs(first["x"][1] - first["x"][0])
        if len(one["data"]) != len(first["data"]) or not np.allclose(
            one["x"], first["x"], rtol=1e-6, atol=step
        ):
            raise ValueError(
                f"sets 58 have {len(first['data'])} and {len(one['data'])} times or frequencies, "
                "or other ones; export them with the same"
            )
        for key in ("ordinate_spec_data_type", "ordinate_axis_units_lab", "func_type"):
            if one.get(key) != first.get(key):
                raise ValueError(
                    f"sets 58 differ in {key}: {str(first.get(key))[:20]}, "
                    f"{str(one.get(key))[:20]}; export one quantity, or choose it by --quantity"
                )


def _by_node(motion: list[dict[str, Any]]) -> list[tuple[int, list[dict[str, Any]]]]:
    """Nodes and their sets, as many of each: of several, repetitions. Sets of other names, at no
    node or of another number at each, are places of their own.
    """
    groups: dict[int, list[dict[str, Any]]] = {}
    for one in motion:
        groups.setdefault(int(one.get("rsp_node", 0)), []).append(one)
    keys = ("rsp_ent_name",) if len(groups) == 1 and 0 not in groups else ("rsp_ent_name", "id1")
    names = {tuple(_text(one, key) for key in keys) for one in motion}
    counts = {len(group) for group in groups.values()}
    if (len(groups) == 1 or len(counts) > 1) and len(names) == len(motion):
        return [(int(one.get("rsp_node", 0)), [one]) for one in motion]
    if len(counts) > 1:
        raise ValueError(
            f"nodes have {min(counts)} to {max(counts)} sets 58; export as many of each"
        )
    return list(groups.items())


def _turned(motion: list[dict[str, Any]]) -> tuple[list[dict[str, Any]], int]:
    """Sets with those along a negative axis turned, and the sign of z, -1; 0 of other axes."""
    of = [int(one.get("rsp_dir", 0)) for one in motion]
    if 0 in of and any(of):
        raise ValueError("some sets 58 have a direction and others none; export one kind")
    if 0 in of:
        return motion, 0
    turned = zip(motion, np.sign(of), strict=True)
    return [one | {"data": sign * one["data"]} for one, sign in turned], -(abs(of[0]) == AXES["z"])


def _unit(one: dict[str, Any], per: float, given: Given) -> tuple[str, str, list[str]]:
    """Quantity and unit of the ordinate, of the file's unit of length if it has none, and what was
    assumed.
    """
    said, per_reference = units.per_reference(_text(one, "ordinate_axis_units_lab"))
    kind = _quantity(one)
    remarks = []
    if one.get("func_type") == IN_FREQUENCY[0] or per_reference:
        remarks.append("frequency responses: values are per unit of the reference")
    if not said and kind and not given.unit:
        said = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s2"}[kind]
        said = f"{1 / per!r} {said}"
        remarks.append(f"the unit is not in the file, {said} is assumed; --unit replaces it")
    return kind, said, remarks


def _in_step(
    values: np.ndarray, others: list[dict[str, Any]],
    groups: list[tuple[int, list[dict[str, Any]]]], in_time: bool,
) -> tuple[np.ndarray, np.ndarray, list[str]]:  # fmt: skip
    """Values (r, n, p) in step by a reference of each, the drive, and sentences."""
    first, nodes = groups[0][1][0], [node for node, _ in groups]
    fitting = [one for one in others if len(one["data"]) == values.shape[1]
               and one.get("func_type") == first.get("func_type")]  # fmt: skip
    if len(fitting) == 1:
        return values, np.asarray(fitting[0]["data"]), []
    count = values.shape[0] * values.shape[2]
    if len(fitting) == count:
        at: dict[int, list[np.ndarray]] = {}
        for one in fitting:
            at.setdefault(int(one.get("rsp_node", 0)), []).append(one["data"])
        if sorted(at) == sorted(nodes) and {len(one) for one in at.values()} == {len(values)}:
            each = np.array([at[node] for node in nodes])
        else:  # in the order of the file
            each = np.array([one["data"] for one in fitting]).reshape(len(nodes), len(values), -1)
        each = np.moveaxis(each, 0, 2)
        if in_time:
            moved, drive, said = aligned(values, each.real)
            return moved, drive, [said]
        turn = np.exp(1j * (np.angle(each[:1, :, :1]) - np.angle(each)))
        return values * turn, each[0, :, 0], ["phases of places are relative to their references"]
    is_alone = values.shape[2] == 1 or (not in_time and first.get("func_type") == IN_FREQUENCY[0])
    return values, np.empty(0), [] if is_alone else [ONE_AFTER_ANOTHER]


def _per_metre(found: list[dict[str, Any]]) -> float:
    """Number of units of length of the file in a metre."""
    told = [float(one.get("length", 1.0)) for one in found if one.get("type") == LENGTH_UNIT]
    return told[0] if told and 0 < told[0] < np.inf else 1.0


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
