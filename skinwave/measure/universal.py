"""Universal File Format 58, functions at nodal degrees of freedom, by pyuff.

Each set is a place and, of several at one place, a repetition. Coordinates are those of the sets 15
or 2411 in the same file, lengths in the unit of set 164.
"""

import re
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from meshes import reading
from skinwave.measure import units
from skinwave.measure.delays import ONE_AFTER_ANOTHER, aligned
from skinwave.measure.recording import Given, Recording, nowhere
from skinwave.typing import Floats

LARGEST = 1_000_000_000  # bytes
MISSING = 'files of Universal File Format 58 need pyuff; pip install "skinwave[measure]"'
FUNCTION, NODES, LENGTH_UNIT = 58, (15, 2411), 164
KINDS = {8: "displacement", 11: "velocity", 12: "acceleration"}
SI = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s2"}
# Types of functions that have a phase: general ones, of time, frequency responses, and spectra.
GENERAL, IN_TIME, RESPONSE, SPECTRUM = 0, 1, 4, 12
TIME, FREQUENCY = 17, 18  # of abscissas
TAG = re.compile(rb"    -1(?=[\r\n]|\Z| {74})")  # line before and after each set
AXES = {"x": 1, "y": 2, "z": 3}  # z is out of the body, the way a vibrometer above it looks
REFERENCE = re.compile(r"ref(erence)?\d*\b", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True, eq=False)
class Function:
    """A set 58: its type, its `quantity` of motion ("" if it is of none) and `unit`, names of its
    response and itself, its node, that of its reference, its signed direction, and values `y` over
    `x`.
    """

    type: int
    quantity: str
    unit: str
    per_reference: bool
    names: tuple[str, str]
    node: int
    ref_node: int
    direction: int
    is_in_time: bool
    is_reference: bool
    x: Floats
    y: np.ndarray


def read(path: Path, given: Given) -> Recording:
    """The recording in a Universal File. Sets of a reference for each place bring the places into
    step; a single one is the drive. Raises a ValueError if there is no motion along the direction,
    or sets do not fit together.
    """
    functions, at, per_metre = _sets(path)
    motion, others = _motion(functions, given)
    first = motion[0]
    _check_alike(motion)
    motion, sign = _turned(motion)
    groups = _by_node(motion)
    values = np.moveaxis(np.array([[one.y for one in group] for _, group in groups]), 0, 2)
    if not first.is_in_time and not np.iscomplexobj(values):
        raise ValueError("its spectra have no phase; export complex spectra or time responses")
    values, drive, said = _in_step(values, others, groups)
    directions = [abs(one.direction) for one in functions if one.quantity]
    if left_out := sum(d not in (0, abs(first.direction)) for d in directions):
        said.append(f"{left_out} functions of other directions are left out")
    if len(groups) == 1 and len(motion) > 1:
        said.append(f"{len(motion)} sets of one node are taken as repetitions")
    if first.type == RESPONSE or first.per_reference:
        said.insert(0, "frequency responses: values are per unit of the reference")
    unit = first.unit
    if not unit and first.quantity and not given.unit:
        unit = f"{1 / per_metre!r} {SI[first.quantity]}"
        said.insert(0, f"the unit is not in the file, {unit} is assumed; --unit replaces it")
    nodes = [node for node, _ in groups]
    places = [at[node] for node in nodes] if set(nodes) <= at.keys() else nowhere(len(nodes))
    return Recording(
        values=values, times=first.x[: values.shape[1]] if first.is_in_time else np.empty(0),
        frequencies=np.empty(0) if first.is_in_time else first.x, quantity=first.quantity,
        unit=unit, places=np.asarray(places) / per_metre, sign=sign, drive=drive,
        name=first.names[1], remarks=tuple(said),
    )  # fmt: skip


def _sets(path: Path) -> tuple[list[Function], dict[int, tuple[float, float]], float]:
    """Functions in a file, coordinates by node, and its units of length in a metre."""
    try:
        import pyuff
    except ImportError:
        raise ValueError(MISSING) from None
    with reading.open_regular(path, LARGEST) as content:
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
        held = ", ".join(map(str, sorted(set(kinds))))
        raise ValueError(
            f"the file has no set 58 of functions{f', but {held}' if held else ''}; export these"
        )
    at: dict[int, tuple[float, float]] = {}
    for one in found:
        if one.get("type") in NODES:
            rows = zip(one["node_nums"], one["x"], one["y"], strict=False)
            at |= {int(node): (float(x), float(y)) for node, x, y in rows}
    lengths = [float(one.get("length", 1.0)) for one in found if one.get("type") == LENGTH_UNIT]
    per_metre = lengths[0] if lengths and 0 < lengths[0] < np.inf else 1.0
    return [_function(one) for one in found if one.get("type") == FUNCTION], at, per_metre


def _function(one: dict[str, Any]) -> Function:
    """A set 58 with as many values as its header tells; bytes of line ends may follow these."""

    def text(key: str) -> str:
        said = str(one.get(key, "")).strip()
        return "" if said.upper() == "NONE" else said

    def number(key: str) -> int:
        return int(one.get(key, 0))

    count, data = number("num_pts"), np.asarray(one.get("data", ()))
    if count < 2 or len(data) < count:
        raise ValueError(
            f"a set 58 has {len(data)} values, and its header tells of {count}; export it anew"
        )
    kind, abscissa = number("func_type"), number("abscissa_spec_data_type")
    is_in_time = abscissa == TIME if abscissa in (TIME, FREQUENCY) else kind == IN_TIME
    unit, per_reference = units.per_reference(text("ordinate_axis_units_lab"))
    known, what = (units.TIMES, "time") if is_in_time else (units.FREQUENCIES, "frequency")
    axis = text("abscissa_axis_units_lab")
    per = units.scale(axis, known, what) if axis else 1.0
    return Function(
        type=kind, unit=unit, per_reference=per_reference,
        quantity=KINDS.get(number("ordinate_spec_data_type"), "") or units.quantity_of(unit),
        names=(text("rsp_ent_name"), text("id1")), node=number("rsp_node"),
        ref_node=number("ref_node"), direction=number("rsp_dir"), is_in_time=is_in_time,
        is_reference=any(REFERENCE.match(text(key)) for key in ("id1", "id2")),
        x=units.in_si(np.asarray(one["x"], float)[:count], per), y=data[:count],
    )  # fmt: skip


def _motion(functions: list[Function], given: Given) -> tuple[list[Function], list[Function]]:
    """Functions of motion with phase along the direction, and those of anything else."""
    with_phase = [f for f in functions if f.type in (GENERAL, IN_TIME, RESPONSE, SPECTRUM)]
    if not with_phase:
        raise ValueError(
            f"its functions are of type {functions[0].type}, which has no phase; export spectra"
        )
    others = [one for one in with_phase if one.is_reference]
    motion = [one for one in with_phase if not one.is_reference]
    of = {one.quantity for one in motion} - {""}
    if of or not (given.unit or given.quantity):
        others += [one for one in motion if not one.quantity]
        wanted = {given.quantity} if given.quantity in of else of
        motion = [one for one in motion if one.quantity in wanted]
    if not motion:
        raise ValueError(
            f"none of its {len(functions)} functions is of displacement, velocity or acceleration; "
            'give --unit, such as "20 mm/s", if they are motion'
        )
    along = AXES[given.direction or "z"]
    at = [one for one in motion if abs(one.direction) in (0, along)]
    nodes = sorted({one.ref_node for one in at})
    if len(nodes) > 1 and all(one.type == RESPONSE for one in at):
        raise ValueError(
            f"its responses have the references {', '.join(map(str, nodes))}; export those of one"
        )
    if not at:
        names = {number: name for name, number in AXES.items()}
        known = sorted({names.get(abs(one.direction), "rotation") for one in motion})
        raise ValueError(
            f"none of its {len(motion)} functions of motion is along {given.direction or 'z'}; "
            f"their directions are {', '.join(known)}; give --direction"
        )
    return at, others


def _check_alike(motion: list[Function]) -> None:
    """Refuse functions that differ in what they are of, or in their times or frequencies."""
    first = motion[0]
    for one in motion[1:]:
        step = 1e-3 * abs(first.x[1] - first.x[0])
        if len(one.y) != len(first.y) or not np.allclose(one.x, first.x, rtol=1e-6, atol=step):
            raise ValueError(
                "sets 58 differ in their times or frequencies; export them with the same"
            )
        for key in ("quantity", "unit", "type"):
            here, there = getattr(first, key), getattr(one, key)
            if here != there:
                raise ValueError(
                    f"sets 58 differ in {key}: {here}, {there}; choose by --quantity, or export one"
                )


def _by_node(motion: list[Function]) -> list[tuple[int, list[Function]]]:
    """Nodes and their functions, as many of each: of several, repetitions. Functions of other
    names, at no node or of another number at each, are places of their own.
    """
    groups: dict[int, list[Function]] = {}
    for one in motion:
        groups.setdefault(one.node, []).append(one)
    alone = len(groups) == 1 and 0 not in groups  # whose titles may tell of repetitions
    names = {one.names[:1] if alone else one.names for one in motion}
    counts = {len(group) for group in groups.values()}
    if (len(groups) == 1 or len(counts) > 1) and len(names) == len(motion):
        return [(one.node, [one]) for one in motion]
    if len(counts) > 1:
        raise ValueError(
            f"nodes have {min(counts)} to {max(counts)} sets 58; export as many of each"
        )
    return list(groups.items())


def _turned(motion: list[Function]) -> tuple[list[Function], int]:
    """Functions with those along a negative axis turned, and the sign of z, -1; 0 of other axes."""
    of = [one.direction for one in motion]
    if 0 in of and any(of):
        raise ValueError("some sets 58 have a direction and others none; export one kind")
    if 0 in of:
        return motion, 0
    turned = [replace(one, y=np.sign(one.direction) * one.y) for one in motion]
    return turned, -(abs(of[0]) == AXES["z"])


def _in_step(
    values: np.ndarray, others: list[Function], groups: list[tuple[int, list[Function]]]
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Values (r, n, p) in step by a reference of each, the drive, and sentences."""
    first, nodes = groups[0][1][0], [node for node, _ in groups]
    runs, count, _ = values.shape
    fitting = [one for one in others if len(one.y) == count and one.type == first.type]
    if len(fitting) == 1:
        return values, fitting[0].y, []
    if len(fitting) == runs * len(nodes):
        at: dict[int, list[np.ndarray]] = {}
        for one in fitting:
            at.setdefault(one.node, []).append(one.y)
        if sorted(at) == sorted(nodes) and {len(one) for one in at.values()} == {runs}:
            each = np.array([at[node] for node in nodes])
        else:  # in the order of the file
            each = np.array([one.y for one in fitting]).reshape(len(nodes), runs, -1)
        each = np.moveaxis(each, 0, 2)
        if first.is_in_time:
            moved, drive, said = aligned(values, each.real)
            return moved, drive, [said]
        turn = np.exp(1j * (np.angle(each[:1, :, :1]) - np.angle(each)))
        return values * turn, each[0, :, 0], ["phases of places are relative to their references"]
    is_alone = len(nodes) == 1 or (not first.is_in_time and first.type == RESPONSE)
    return values, np.empty(0), [] if is_alone else [ONE_AFTER_ANOTHER]
