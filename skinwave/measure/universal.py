"""Universal File Format 58, functions at nodal degrees of freedom, by pyuff.

Each set is a place; further sets of a node are repetitions. Coordinates are those of the sets 15 or
2411 in the same file, lengths in the unit of set 164.
"""

import re
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from meshes import reading
from skinwave.measure import units
from skinwave.measure.delays import NOT_SIMULTANEOUS, align_by_references
from skinwave.measure.recording import Given, Recording, unknown_places
from skinwave.typing import Floats

LARGEST = 1_000_000_000  # bytes
FUNCTION, NODES, LENGTH_UNIT = 58, (15, 2411), 164  # types of sets
QUANTITIES = {8: "displacement", 11: "velocity", 12: "acceleration"}
SI = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s2"}
GENERAL, IN_TIME, RESPONSE, SPECTRUM = 0, 1, 4, 12  # types of functions that have a phase
TIME, FREQUENCY = 17, 18  # types of abscissas
SET_TAG = re.compile(rb"    -1(?=[\r\n]|\Z| {74})")  # line before and after each set
AXES = {"x": 1, "y": 2, "z": 3}  # z is out of the body, towards a vibrometer above it
REFERENCE = re.compile(r"ref(erence)?\d*\b", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True, eq=False)
class Function:
    """A set 58."""

    type: int
    quantity: str  # of motion, or ""
    unit: str
    is_per_reference: bool
    names: tuple[str, str]  # of the response entity, and of the function
    node: int
    reference_node: int
    direction: int  # signed number of the axis, 0 if unknown
    is_in_time: bool
    is_reference: bool
    x: Floats
    y: np.ndarray


def read(path: Path, given: Given) -> Recording:
    """Return the recording in a Universal File.

    References recorded with each place align the places; a single reference is the drive. Raises a
    ValueError if no motion is along the direction, or if the sets do not fit together.
    """
    functions, positions, per_metre = _sets(path)
    motion, others = _motion(functions, given)
    _check_alike(motion)
    motion, sign = _along_axis(motion)
    first, groups = motion[0], _by_node(motion)
    values = np.moveaxis(np.array([[one.y for one in group] for _, group in groups]), 0, 2)
    if not first.is_in_time and not np.iscomplexobj(values):
        raise ValueError("the spectra have no phase; export complex spectra or time responses")
    nodes = [node for node, _ in groups]
    values, drive, remarks = _align(values, others, first, nodes)
    directions = [abs(one.direction) for one in functions if one.quantity]
    if left_out := sum(d not in (0, abs(first.direction)) for d in directions):
        remarks.append(f"{left_out} functions of other directions are left out")
    if len(groups) == 1 and len(motion) > 1:
        remarks.append(f"{len(motion)} sets of one node are taken as repetitions")
    if first.type == RESPONSE or first.is_per_reference:
        remarks.insert(0, "frequency responses: values are per unit of the reference")
    unit = first.unit
    if not unit and first.quantity and not given.unit:
        unit = f"{1 / per_metre!r} {SI[first.quantity]}"
        remarks.insert(0, f"the file gives no unit; {unit} is assumed, and --unit replaces it")
    places = unknown_places(len(nodes))
    if set(nodes) <= positions.keys():
        places = np.array([positions[node] for node in nodes]) / per_metre
    times, frequencies = first.x[: values.shape[1]], np.empty(0)
    if not first.is_in_time:
        times, frequencies = frequencies, first.x
    return Recording(
        values=values, times=times, frequencies=frequencies, quantity=first.quantity, unit=unit,
        places=places, sign=sign, drive=drive, name=first.names[1], remarks=tuple(remarks),
    )  # fmt: skip


def _sets(path: Path) -> tuple[list[Function], dict[int, tuple[float, float]], float]:
    """Return functions, coordinates by node, and the number of units of length per metre."""
    try:
        import pyuff
    except ImportError:
        raise ValueError('Universal Files need pyuff; pip install "skinwave[measure]"') from None
    with reading.open_regular(path, LARGEST) as content:
        if len(SET_TAG.findall(content.read())) % 2:
            raise ValueError("the file ends within a set; export it again")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            file = pyuff.UFF(str(path))
            types = [int(kind) for kind in file.get_set_types()]
            wanted = {FUNCTION, *NODES, LENGTH_UNIT}
            sets = [file.read_sets(k) for k, kind in enumerate(types) if kind in wanted]
    except Exception:  # pyuff raises plain exceptions
        raise ValueError("the file is damaged or not a Universal File; export it as text") from None
    if FUNCTION not in types:
        known = f", only {', '.join(map(str, sorted(set(types))))}" if types else ""
        raise ValueError(f"the file has no set 58{known}; export functions")
    positions: dict[int, tuple[float, float]] = {}
    for one in sets:
        if one.get("type") in NODES:
            rows = zip(one["node_nums"], one["x"], one["y"], strict=False)
            positions |= {int(node): (float(x), float(y)) for node, x, y in rows}
    lengths = [float(one.get("length", 1.0)) for one in sets if one.get("type") == LENGTH_UNIT]
    per_metre = lengths[0] if lengths and 0 < lengths[0] < np.inf else 1.0
    return [_function(one) for one in sets if one.get("type") == FUNCTION], positions, per_metre


def _function(one: dict[str, Any]) -> Function:
    """Return a set 58 with as many values as its header states; line ends may follow these."""

    def text(key: str) -> str:
        value = str(one.get(key, "")).strip()
        return "" if value.upper() == "NONE" else value

    def number(key: str) -> int:
        return int(one.get(key, 0))

    count, data = number("num_pts"), np.asarray(one.get("data", ()))
    if count < 2 or len(data) < count:
        raise ValueError(f"a set 58 has {len(data)} of {count} values; export it again")
    kind, abscissa = number("func_type"), number("abscissa_spec_data_type")
    is_in_time = abscissa == TIME if abscissa in (TIME, FREQUENCY) else kind == IN_TIME
    unit, is_per_reference = units.per_reference(text("ordinate_axis_units_lab"))
    known, dimension = (units.TIMES, "time") if is_in_time else (units.FREQUENCIES, "frequency")
    axis = text("abscissa_axis_units_lab")
    divisor = units.divisor(axis, known, dimension) if axis else 1.0
    return Function(
        type=kind, unit=unit, is_per_reference=is_per_reference,
        quantity=QUANTITIES.get(number("ordinate_spec_data_type"), "") or units.quantity_of(unit),
        names=(text("rsp_ent_name"), text("id1")), node=number("rsp_node"),
        reference_node=number("ref_node"), direction=number("rsp_dir"), is_in_time=is_in_time,
        is_reference=any(REFERENCE.match(text(key)) for key in ("id1", "id2")),
        x=units.in_si(np.asarray(one["x"], float)[:count], divisor), y=data[:count],
    )  # fmt: skip


def _motion(functions: list[Function], given: Given) -> tuple[list[Function], list[Function]]:
    """Return functions of motion along the direction, with phase, and all others."""
    with_phase = [f for f in functions if f.type in (GENERAL, IN_TIME, RESPONSE, SPECTRUM)]
    if not with_phase:
        raise ValueError(f"functions of type {functions[0].type} have no phase; export spectra")
    others = [one for one in with_phase if one.is_reference]
    motion = [one for one in with_phase if not one.is_reference]
    quantities = {one.quantity for one in motion} - {""}
    if quantities or not (given.unit or given.quantity):
        others += [one for one in motion if not one.quantity]
        wanted = {given.quantity} if given.quantity in quantities else quantities
        motion = [one for one in motion if one.quantity in wanted]
    if not motion:
        raise ValueError('no function has a unit of motion; give --unit, such as "20 mm/s"')
    direction = given.direction or "z"
    along = [one for one in motion if abs(one.direction) in (0, AXES[direction])]
    if not along:
        names = {number: name for name, number in AXES.items()}
        known = sorted({names.get(abs(one.direction), "rotation") for one in motion})
        raise ValueError(f"no motion is along {direction}; give --direction {', '.join(known)}")
    nodes = sorted({one.reference_node for one in along})
    if len(nodes) > 1 and all(one.type == RESPONSE for one in along):
        raise ValueError(f"responses have the references {', '.join(map(str, nodes))}; export one")
    return along, others


def _check_alike(motion: list[Function]) -> None:
    """Raise a ValueError if functions differ in quantity, unit, type, times or frequencies."""
    first = motion[0]
    step = 1e-3 * abs(first.x[1] - first.x[0])
    for one in motion[1:]:
        if len(one.y) != len(first.y) or not np.allclose(one.x, first.x, rtol=1e-6, atol=step):
            raise ValueError(
                "datasets 58 differ in times or frequencies; export them with equal ones"
            )
        for key in ("quantity", "unit", "type"):
            values = getattr(first, key), getattr(one, key)
            if values[0] != values[1]:
                each = ", ".join(map(str, values))
                raise ValueError(f"datasets 58 differ in {key}: {each}; give --quantity")


def _by_node(motion: list[Function]) -> list[tuple[int, list[Function]]]:
    """Return nodes with equal numbers of functions; functions with distinct names are places."""
    groups: dict[int, list[Function]] = {}
    for one in motion:
        groups.setdefault(one.node, []).append(one)
    is_one_node = len(groups) == 1 and 0 not in groups  # whose titles may number repetitions
    names = {one.names[:1] if is_one_node else one.names for one in motion}
    counts = {len(group) for group in groups.values()}
    if (len(groups) == 1 or len(counts) > 1) and len(names) == len(motion):
        return [(one.node, [one]) for one in motion]
    if len(counts) > 1:
        raise ValueError(f"nodes have {min(counts)} to {max(counts)} sets 58; export equally many")
    return list(groups.items())


def _along_axis(motion: list[Function]) -> tuple[list[Function], int]:
    """Return functions along the positive axis, and the sign into the body: -1 for z, else 0."""
    directions = [one.direction for one in motion]
    if 0 in directions and any(directions):
        raise ValueError("only some sets 58 have a direction; export one kind")
    if 0 in directions:
        return motion, 0
    turned = [replace(one, y=np.sign(one.direction) * one.y) for one in motion]
    return turned, -(abs(directions[0]) == AXES["z"])


def _align(
    values: np.ndarray, others: list[Function], first: Function, nodes: list[int]
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Return values (r, n, p) aligned by the reference of each, the drive, and remarks."""
    runs, count, _ = values.shape
    references = [one for one in others if len(one.y) == count and one.type == first.type]
    if len(references) == 1:
        return values, references[0].y, []
    if len(references) != runs * len(nodes):
        is_simultaneous = len(nodes) == 1 or (not first.is_in_time and first.type == RESPONSE)
        return values, np.empty(0), [] if is_simultaneous else [NOT_SIMULTANEOUS]
    by_node: dict[int, list[np.ndarray]] = {}
    for one in references:
        by_node.setdefault(one.node, []).append(one.y)
    if sorted(by_node) == sorted(nodes) and {len(one) for one in by_node.values()} == {runs}:
        each = np.array([by_node[node] for node in nodes])
    else:  # in the order of the file
        each = np.array([one.y for one in references]).reshape(len(nodes), runs, -1)
    each = np.moveaxis(each, 0, 2)
    if first.is_in_time:
        moved, drive, remark = align_by_references(values, each.real)
        return moved, drive, [remark]
    turn = np.exp(1j * (np.angle(each[:1, :, :1]) - np.angle(each)))
    return values * turn, each[0, :, 0], ["phases of places are relative to their references"]
