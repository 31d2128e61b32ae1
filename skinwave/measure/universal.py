"""Universal File Format 58, functions at nodal degrees of freedom.

Each set is a place; further sets of a node are repetitions. Coordinates are those of the sets 15 or
2411 in the same file, lengths in the unit of set 164.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from meshes import reading
from simple_model.quantities import QUANTITIES
from skinwave.measure.delays import align_by_references
from skinwave.measure.recording import Given, Recording, unknown_places
from skinwave.system import units
from skinwave.system.formats import MEASUREMENTS, register
from skinwave.typing import Floats

IN_TIME, RESPONSE = 1, 4  # types of functions that have a phase
AXES = {"x": 1, "y": 2, "z": 3}  # z is out of the body, towards a vibrometer above it


@dataclass(frozen=True, kw_only=True, eq=False)
class Function:
    """A set 58, or a function of SDynPy."""

    type: int
    quantity: str = ""  # of motion
    unit: str = ""
    is_per_reference: bool = False
    names: tuple[str, str]  # of the response entity, and of the function
    at: tuple[int, int]  # node and signed number of the axis of the response, 0 if unknown,
    by: tuple[int, int] = (0, 0)  # and of the excitation of a frequency response
    is_in_time: bool
    is_reference: bool = False
    is_other: bool = False  # no motion, such as a force
    x: Floats
    y: np.ndarray


def read(path: Path, given: Given) -> Recording:
    """Return the recording in a Universal File."""
    return recording_of(given, *_sets(path))


def recording_of(
    given: Given,
    functions: list[Function],
    positions: Mapping[int, tuple[float, float]] | None = None,
    per_metre: float = 1.0,
) -> Recording:
    """Return the recording in functions at nodes with given positions, in a unit of length.

    References recorded with each place align the places; a single reference is the drive. Raises a
    ValueError if no motion is along the direction, or if the sets do not fit together.
    """
    motion, others = _motion(functions, given)
    _check_alike(motion)
    motion, sign = _along_axis(motion, given)
    first, groups = motion[0], _by_node(motion)
    values = np.moveaxis(np.array([[one.y for one in group] for _, group in groups]), 0, 2)
    if not first.is_in_time and not np.iscomplexobj(values):
        raise ValueError("the spectra have no phase; export complex spectra or time responses")
    nodes = [node for node, _ in groups]
    values, drive, remarks = _align(values, others, first, nodes)
    known = [one for one in functions if not (one.is_other or one.is_reference)]
    if left_out := sum(one.at[1] not in (0, first.at[1], -first.at[1]) for one in known):
        remarks.append(f"{left_out} functions of other directions are left out")
    if len(groups) == 1 and len(motion) > 1:
        remarks.append(f"{len(motion)} sets of one node are taken as repetitions")
    if first.type == RESPONSE or first.is_per_reference:
        remarks.insert(0, "frequency responses: values are per unit of the reference")
        remarks += _driving_points(motion, given)
    unit, level = units.split_level(first.unit)
    if not unit and first.quantity and not given.unit:
        unit = f"{1 / per_metre!r} {QUANTITIES[first.quantity].unit}"
        remarks.insert(0, f"the file gives no unit; {unit} is assumed, and --unit replaces it")
    places = unknown_places(len(nodes))
    if positions and set(nodes) <= positions.keys():
        places = np.array([positions[node] for node in nodes]) / per_metre
    times, frequencies = first.x[: values.shape[1]], np.empty(0)
    if not first.is_in_time:
        times, frequencies = frequencies, first.x
    return Recording(
        values=values, times=times, frequencies=frequencies, quantity=first.quantity,
        unit=f"{unit} {level}".strip(), places=places, sign=sign, drive=drive, name=first.names[1],
        remarks=tuple(remarks),
    )  # fmt: skip


def _sets(path: Path) -> tuple[list[Function], dict[int, tuple[float, float]], float]:
    """Return functions, coordinates by node, and the number of units of length per metre."""
    content = reading.read_bytes(path, 1_000_000_000)
    tag = rb"    -1(?=[\r\n]|\Z| {74})"  # line before and after each set
    tags = [match.start() for match in re.finditer(tag, content)]
    if len(tags) % 2:
        raise ValueError("the file ends within a set; export it again")
    functions, types, per_metre = [], set[int](), 1.0
    positions: dict[int, tuple[float, float]] = {}
    function, nodes, length_unit = 58, (15, 2411), 164  # types of sets
    for begin, end in zip(tags[::2], tags[1::2], strict=True):
        block = content[begin:end]
        kind = int(found[1]) if (found := re.match(rb"[^\r\n]*[\r\n]+ *(\d+)", block)) else 0
        types.add(kind)
        if kind == function:
            functions.append(_function(block))
        elif kind in nodes:  # node, three integers, x, y, z
            rows = _text_numbers(b" ".join(block.splitlines()[2:]))
            rows = rows[: len(rows) // 7 * 7].reshape(-1, 7)
            positions |= {int(node): (x, y) for node, *_, x, y, _ in rows.tolist()}
        elif kind == length_unit:
            length = _text_numbers(b" ".join(block.splitlines()[3:]))[:1]
            per_metre = float(length[0]) if len(length) and 0 < length[0] < np.inf else 1.0
    if not functions:
        known = f", only {', '.join(map(str, sorted(types)))}" if types else ""
        raise ValueError(f"the file has no set 58{known}; export functions")
    return functions, positions, per_metre


def _function(block: bytes) -> Function:
    """Return the function in the text of a set 58, or of a set 58b with binary values."""
    head = re.match(rb"(?:[^\r\n]*(?:\r\n|\r|\n)){13}", block)
    if not head:
        raise ValueError("a set 58 ends within its header; export it again")
    lines = head[0].decode(errors="replace").splitlines()

    def cells(line: int, *widths: int) -> list[str]:
        ends = np.cumsum(widths)
        each = (lines[line][end - n : end].strip() for end, n in zip(ends, widths, strict=True))
        return ["" if cell.upper() == "NONE" else cell for cell in each]

    try:
        at_by = cells(7, 5, 10, 5, 10, 11, 10, 4, 11, 10, 4)
        kind, *ends = (int(at_by[k] or 0) for k in (0, 5, 6, 8, 9))
        form, count, is_even = (int(x or 0) for x in cells(8, 10, 10, 10))
        start, step = (float(x.upper().replace("D", "E") or 0) for x in cells(8, 30, 13, 13)[1:])
        abscissa, ordinate = (int(cells(k, 10)[0] or 0) for k in (9, 10))
        axis, unit, per = (cells(k, 46, 21)[1] for k in (9, 10, 11))
        label = cells(10, 25, 21)[1]
        values = _numbers(block[head.end() :], form, cells(1, 7, 6, 6))
    except ValueError as error:
        problem = (
            str(error) if "export" in str(error) else "a dataset 58 has a damaged header or value"
        )
        raise ValueError(f"{problem.partition('; ')[0]}; export it again as text") from None
    is_complex = form in (5, 6)  # types of values
    parts = 1 + is_complex + (not is_even)
    values = values[: len(values) // parts * parts].reshape(-1, parts)
    is_text = "b" not in lines[1].lower()  # line ends may follow binary values
    row = 6  # values of a line of text, which may be filled up
    if count < 2 or len(values) < count or (is_text and len(values) > count + row):
        raise ValueError(f"a set 58 has {len(values)} of {count} values; export it again")
    x = start + step * np.arange(count) if is_even else values[:count, 0]
    y = values[:count, -2:] @ np.array([1, 1j]) if is_complex else values[:count, -1]
    time, frequency = 17, 18  # types of abscissas
    is_in_time = abscissa == time if abscissa in (time, frequency) else kind == IN_TIME
    dimension = "time" if is_in_time else "frequency"
    alone, over = units.per_reference(unit), units.per_reference(f"{unit}/{per}")
    unit, is_per_reference = over if over[1] > alone[1] else alone
    ids = [line.strip() for line in lines[2:7]]
    said = [label, *([] if is_in_time or kind == RESPONSE else ids)]
    level = next(filter(None, (units.split_level(text)[1] for text in [unit, *said])), "")
    bare = units.split_level(unit)[0]
    quantities = {8: "displacement", 11: "velocity", 12: "acceleration"}
    return Function(
        type=kind, unit=f"{bare} {level}".strip(), is_per_reference=is_per_reference,
        quantity=quantities.get(ordinate, "") or units.quantity_of(bare),
        names=(at_by[4], "" if ids[0].upper() == "NONE" else ids[0]),
        at=(ends[0], ends[1]), by=(ends[2], ends[3]) if kind == RESPONSE else (0, 0),
        is_in_time=is_in_time,
        is_reference=any(re.match(r"ref(erence)?\d*\b", x, re.IGNORECASE) for x in ids[:2]),
        is_other=ordinate not in (0, 1, *quantities), y=y,
        x=units.in_si(x, units.divisor(axis, dimension) if axis else 1.0),
    )  # fmt: skip


def _numbers(body: bytes, form: int, coding: list[str]) -> Floats:
    """Return the numbers of a set: of text in columns of any width, or binary ones."""
    single = (2, 5)  # types of values
    if coding[0].lower() == "58b":
        if coding[2] not in ("", "2"):
            raise ValueError("binary values that are not IEEE 754 are not supported; export text")
        kind = ("<" if coding[1] == "1" else ">") + ("f4" if form in single else "f8")
        size = np.dtype(kind).itemsize
        return np.frombuffer(body[: len(body) // size * size], kind).astype(np.float64)
    return _text_numbers(body)


def _text_numbers(body: bytes) -> Floats:
    """Return the numbers in a text, also "1.5-100" of Fortran."""
    number = rb"[-+]?(?:(?:\d+\.?\d*|\.\d+)(?:[ED][-+]?\d+|[-+]\d{3}(?![\d.]))?|nan|inf)"
    texts = re.findall(number, body.replace(b"d", b"D").replace(b"D", b"E"), re.IGNORECASE)
    short = re.compile(r"(\d)([-+]\d{3})$")
    return np.array([float(short.sub(r"\1E\2", text.decode())) for text in texts])


def _motion(functions: list[Function], given: Given) -> tuple[list[Function], list[Function]]:
    """Return functions of motion along the direction, with phase, and all others."""
    general, spectrum = 0, 12  # types of functions that have a phase
    with_phase = [f for f in functions if f.type in (general, IN_TIME, RESPONSE, spectrum)]
    if not with_phase:
        cure = "export waveforms, spectra or frequency responses"
        raise ValueError(f"functions of type {functions[0].type} are not supported; {cure}")
    motion = [f for f in with_phase if not f.is_reference and (f.quantity or not f.is_other)]
    others = [f for f in with_phase if f.is_reference or not f.quantity]
    if quantities := {one.quantity for one in motion} - {""}:
        wanted = {given.quantity} & quantities or quantities
        motion = [one for one in motion if one.quantity in wanted]
    elif given.unit or given.quantity:
        others = [one for one in others if one not in motion]
    else:
        motion = []
    if not motion:
        if all(one.is_other for one in with_phase):
            raise ValueError("no function is displacement, velocity or acceleration; export motion")
        raise ValueError('no function has a unit of motion; give --unit, such as "20 mm/s"')
    direction = given.direction or "z"
    along = [one for one in motion if abs(one.at[1]) in (0, AXES[direction])]
    names = {number: name for name, number in AXES.items()}
    if not along:
        known = sorted({names.get(abs(one.at[1]), "rotation") for one in motion})
        raise ValueError(f"no motion is along {direction}; give --direction {', '.join(known)}")
    along = [one for one in along if abs(one.by[1]) in (0, AXES[direction])] or along
    excited = {(abs(one.by[1]), one.by[0]) for one in along}
    if len(excited) > 1:
        one_axis = len({axis for axis, _ in excited}) == 1
        each = [f"{node} {names.get(axis, '')}"[: len(str(node)) if one_axis else None].strip()
                for axis, node in sorted(excited)]  # fmt: skip
        raise ValueError(f"responses have the references {', '.join(each)}; export one")
    return along, others


def _check_alike(motion: list[Function]) -> None:
    """Raise a ValueError if functions differ in quantity, unit, type, times or frequencies."""
    first = motion[0]
    step = 1e-3 * abs(first.x[1] - first.x[0])
    for one in motion[1:]:
        if len(one.y) != len(first.y) or not np.allclose(one.x, first.x, rtol=1e-6, atol=step):
            raise ValueError("sets 58 differ in times or frequencies; export them with equal ones")
        for key in ("quantity", "unit", "type"):
            values = getattr(first, key), getattr(one, key)
            if values[0] != values[1]:
                raise ValueError(
                    f"sets 58 differ in {key}: {values[0]}, {values[1]}; give --quantity"
                )


def _by_node(motion: list[Function]) -> list[tuple[int, list[Function]]]:
    """Return nodes with equal numbers of functions; functions with distinct names are places."""
    groups: dict[int, list[Function]] = {}
    for one in motion:
        groups.setdefault(one.at[0], []).append(one)
    is_one_node = len(groups) == 1 and 0 not in groups  # whose titles may number repetitions
    names = {one.names[:1] if is_one_node else one.names for one in motion}
    counts = {len(group) for group in groups.values()}
    if (len(groups) == 1 or len(counts) > 1) and len(names) == len(motion):
        return [(one.at[0], [one]) for one in motion]
    if len(counts) > 1:
        raise ValueError(f"nodes have {min(counts)} to {max(counts)} sets 58; export equally many")
    return list(groups.items())


def _along_axis(motion: list[Function], given: Given) -> tuple[list[Function], int]:
    """Return functions along the positive axis, and the sign into the body.

    The sign is -1 for z, and 0 for other axes. If the excitation has a direction too, the response
    along both positive axes equals that of both into the body, so the sign is 1.
    """
    at, by = ({abs(one[1]) for one in each} for each in ([f.at for f in motion],
                                                         [f.by for f in motion]))  # fmt: skip
    if any(0 in both and any(both) for both in (at, by)):
        raise ValueError("only some sets 58 have a direction; export one kind")
    if not any(at):
        return motion, 0
    axis, excited = at.pop(), by.pop()
    if excited not in (0, axis) and not given.sign:
        cure = "export responses to a force along the motion, or give --positive"
        raise ValueError(f"motion and excitation are along different axes; {cure}")
    signs = [np.sign(one.at[1]) * (np.sign(one.by[1]) or 1) for one in motion]
    turned = [replace(one, y=sign * one.y) for one, sign in zip(motion, signs, strict=True)]
    return turned, 1 if excited else -(axis == AXES["z"])


def _driving_points(motion: list[Function], given: Given, least: float = 0.1) -> list[str]:
    """Return warnings of driving points that give energy to the excitation.

    `least` is the smallest share of the mobility that counts.
    """
    quantity = motion[0].quantity or given.quantity or units.quantity_of(given.unit)
    warned = []
    for one in motion if quantity in units.MOTION else ():
        moving = one.x > 0
        order = 1 - list(units.MOTION).index(quantity)
        mobility = one.y[moving] * (2j * np.pi * one.x[moving]) ** order
        is_driven = one.at[0] == one.by[0] and abs(one.at[1]) == abs(one.by[1])
        if is_driven and mobility.real.sum() < -least * np.abs(mobility).sum():
            warned.append(f"the body gives energy to the excitation at node {one.at[0]}: its sign "
                          "or that of the phase is wrong; check --positive")  # fmt: skip
    return warned


def _align(
    values: np.ndarray, others: list[Function], first: Function, nodes: list[int]
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Return values (r, n, p) aligned by the reference of each, the drive, and remarks."""
    runs, count, _ = values.shape
    references = [one for one in others if len(one.y) == count and one.type == first.type]
    if len(references) == 1:
        return values, references[0].y, []
    not_simultaneous = (
        "the file has no reference for each place: places are taken as simultaneous, and phases "
        "between them are wrong unless one trigger started all"
    )
    if len(references) != runs * len(nodes):
        is_simultaneous = len(nodes) == 1 or (not first.is_in_time and first.type == RESPONSE)
        return values, np.empty(0), [] if is_simultaneous else [not_simultaneous]
    by_node: dict[int, list[np.ndarray]] = {}
    for one in references:
        by_node.setdefault(one.at[0], []).append(one.y)
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


register(MEASUREMENTS, ".uff", ".unv", ".uf", ".58", function=read, choices=("direction",),
         name="Universal File Format 58")  # fmt: skip
