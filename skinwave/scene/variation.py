"""Design of a sweep: keys of a scene file, their values, and how these are combined."""

import hashlib
import itertools
import json
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from meshes import reading
from meshes.tetmesh import Floats
from simple_model.choices import choose, meant
from simple_model.layers.material import PRESETS
from skinwave.scene.distributions import Distribution, called, without_spreads
from skinwave.scene.file import content, dumps, from_table, loads, parsed, read, to_table
from skinwave.scene.keys import SCALES, SECTIONS, with_key, write_material
from skinwave.scene.scene import BODIES, Scene, solid_of, with_body
from skinwave.scene.spreads import scaled
from skinwave.system.plain_text import number_in

DESIGNS = ("factorial", "zip", "lhs", "sobol")
SAMPLED = ("lhs", "sobol")  # of which --samples says how many
MOST_RUNS = 100_000
EDGE = 1e-9  # of the unit interval, which keeps quantiles finite
BODY = "body"  # the key of a whole body: the name of a preset, or a file


@dataclass(frozen=True, kw_only=True)
class Variation:
    """A key of a scene file, and its `values` or, for designs of samples, the `bounds` of them or
    their `distribution` about a `centre`.
    """

    key: str
    values: tuple[Any, ...] = ()
    bounds: tuple[float, float] | None = None
    distribution: Distribution | None = None
    centre: float = 0.0

    def placed(self, share: float) -> Any:
        """Value at a share 0..1 of all: the quantile of a distribution."""
        if self.distribution:
            inner = min(max(share, EDGE), 1 - EDGE)
            return float(self.distribution.quantile(self.centre, inner))
        if self.bounds:
            low, high = self.bounds
            return low + share * (high - low)
        return self.values[min(int(share * len(self.values)), len(self.values) - 1)]


@dataclass(frozen=True, kw_only=True)
class DesignPoint:
    """One run that is wanted: its `varied` keys, the scene that they make or the `error` why they
    make none, the `keys` of that scene's file, and its `text`; and the scene that it is `before`
    factors on all moduli or losses of a material.
    """

    varied: Mapping[str, Any]
    keys: Mapping[str, float | str]
    text: str
    scene: Scene | None = None
    before: Scene | None = None
    error: str = ""

    def name(self, *model_options: object) -> str:
        """A hash of the complete scene, of the file of its body, and of the solver options."""
        digest = hashlib.sha256(repr((self.text, *model_options)).encode())
        if self.scene and self.scene.body.file:
            digest.update(_content(self.scene.body.file))
        return digest.hexdigest()[:24]


def parse(text: str) -> Variation:
    """Variation of `key=v1,v2`, `key=start:stop:n` or, within bounds, `key=start:stop`; or by a
    distribution, as `key=normal(25e3,0.3)`.

    Raises
    ------
    ValueError
        If the key is none of a scene, there is no value, or no such distribution.
    """
    key, equals, right = text.partition("=")
    key = _known(key.strip())
    if not equals or not right.strip():
        raise ValueError(f"--vary {text} lacks values; write {key}=v1,v2 or {key}=start:stop:n")
    if found := called(right):
        return Variation(key=key, centre=found[0], distribution=found[1])
    numbers = [number_in(part) for part in right.split(":")]
    if len(numbers) == 1 or None in numbers:
        return Variation(key=key, values=tuple(map(_value, _split(right))))
    if len(numbers) > 3 or not all(math.isfinite(x) for x in numbers if x is not None):
        raise ValueError(f"--vary {text} is no finite start:stop:n; write three finite numbers")
    start, stop, *count = (x for x in numbers if x is not None)
    if not count:
        return Variation(key=key, bounds=(start, stop))
    if not (count[0] == int(count[0]) and 1 <= count[0] <= MOST_RUNS):
        raise ValueError(
            f"--vary {text} asks for {count[0]:g} values; give a whole number, 1..{MOST_RUNS:,}"
        )
    return Variation(key=key, values=tuple(np.linspace(start, stop, int(count[0])).tolist()))


def combinations(
    variations: Sequence[Variation],
    design: str = "factorial",
    samples: int | None = None,
    seed: int = 0,
) -> list[dict[str, Any]]:
    """The values that meet in each run, by key.

    Parameters
    ----------
    design : "factorial", every value with every other; "zip", first with first; "lhs", a Latin
        hypercube of so many `samples` within bounds, over lists and by distributions, the same for
        the same `seed`; or "sobol", for Sobol' indices, with so many samples of each matrix

    Raises
    ------
    ValueError
        If keys are varied twice or not in the way that the design takes.
    """
    choose("design", design, DESIGNS)
    keys = [variation.key for variation in variations]
    if not keys:
        raise ValueError("nothing is varied; give --vary key=v1,v2 at least once")
    if twice := [key for key in dict.fromkeys(keys) if keys.count(key) > 1]:
        raise ValueError(f"{twice[0]} is varied twice; give all its values at once")
    if (samples is None) == (design in SAMPLED):
        raise ValueError("--samples and --design lhs or sobol need each other; give both or none")
    if design in SAMPLED:
        return _sampled(variations, design, samples or 0, seed)
    for variation in variations:
        if variation.distribution:
            raise ValueError(
                f"{variation.key} has a distribution; give --design lhs or sobol, and --samples"
            )
        if variation.bounds:
            raise ValueError(f"{variation.key}=start:stop lacks the number of values; add :n")
    lengths = [len(variation.values) for variation in variations]
    if design == "zip" and len(set(lengths)) > 1:
        raise ValueError(
            f"--design zip pairs lists of one length, not of {lengths}; take factorial"
        )
    count = lengths[0] if design == "zip" else math.prod(lengths)
    _check_count(count)
    values = [variation.values for variation in variations]
    met = zip(*values, strict=True) if design == "zip" else itertools.product(*values)
    return [dict(zip(keys, each, strict=True)) for each in met]


def cases(path: Path, combined: Sequence[Mapping[str, Any]]) -> list[DesignPoint]:
    """The scenes that a scene file and each combination of values make, each once.

    A combination that makes no scene is a case with its error.

    Raises
    ------
    ValueError
        If the file is no scene, no combination makes one, or a word is refused by each it is in.
    """
    base = read(path)
    table = parsed(content(path), path.parent)
    if base.body.file:
        table["body"]["file"] = base.body.file
    return cases_of(table, tomllib.loads(dumps(base)), combined)


def cases_of(table: Any, complete: Any, combined: Sequence[Mapping[str, Any]]) -> list[DesignPoint]:
    """The same for the table of a scene file, and that with all keys that it leaves out."""
    found = {case.text: case for case in (_case(table, complete, each) for each in combined)}
    _refuse_words(list(found.values()))
    return list(found.values())


def varied(scene: Scene, values: Mapping[str, Any]) -> Scene:
    """A scene with other values of keys of its file.

    Raises
    ------
    ValueError
        If that is no scene.
    """
    complete = to_table(scene)
    return from_table(_changed(complete, complete, values))


def saltelli_shares(d: int, n: int, seed: int = 0) -> Floats:
    """Quantiles' shares (n (d + 2), d), above 0 and below 1, for Sobol' indices: matrices A, B and,
    for each number, A with its column of B, from a Sobol' sequence of 2 d numbers.

    Saltelli et al., Comput Phys Commun 181:259 (2010), section 3.

    Parameters
    ----------
    d : how many numbers
    n : rows of each matrix, a power of two, which balances the sequence
    seed : of the scrambling (Owen, J Complex 14:466 (1998))

    Returns
    -------
    A, B, then A with column k of B for each k, one above the other

    Raises
    ------
    ValueError
        If n is no power of two.
    """
    from scipy.stats import qmc

    if n < 2 or n & (n - 1):
        near = 2 ** max(1, round(np.log2(max(n, 2))))
        raise ValueError(f"{n} samples of each matrix are no power of two; take {near}")
    a, b = np.split(qmc.Sobol(2 * d, rng=seed).random(n), 2, axis=1)
    mixed = np.tile(a, (d, 1, 1))
    for k in range(d):
        mixed[k, :, k] = b[:, k]
    return np.clip(np.vstack([a, b, *mixed]), EDGE, 1 - EDGE)


def _sampled(
    variations: Sequence[Variation], design: str, samples: int, seed: int
) -> list[dict[str, Any]]:
    from scipy.stats import qmc

    d = len(variations)
    if design == "lhs":
        _check_count(samples)
        points = qmc.LatinHypercube(d, rng=seed).random(samples)
    else:
        _check_count(samples * (d + 2))
        points = saltelli_shares(d, samples, seed)
    return [
        {v.key: v.placed(float(x)) for v, x in zip(variations, point, strict=True)}
        for point in points
    ]


def _check_count(count: int) -> None:
    if not 1 <= count <= MOST_RUNS:
        raise ValueError(f"{count:,} runs are outside 1..{MOST_RUNS:,}; vary fewer values")


def _known(key: str) -> str:
    """The key, if a scene has it; parts of a value, as in body.material.poisson, are checked when
    the scene is read.
    """
    known = [f"{section}.{name}" for section, keys in SECTIONS.items() for name in keys]
    if key != BODY and ".".join(key.split(".")[:2]) not in known:
        hint = meant(key, known) or "; a key is of the form tacton.size_mm"
        raise ValueError(f"'{key}' is no key of a scene{hint}")
    return key


def _value(text: str) -> Any:
    """A value as the scene file would have it; a word needs no quotes."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (tomllib.TOMLDecodeError, RecursionError):
        number = number_in(text)
        return text.strip() if number is None else number


def _split(text: str) -> list[str]:
    """Parts between commas that are not within brackets or quotes."""
    parts, depth, quote = [""], 0, ""
    for letter in text:
        if quote or letter in "\"'":
            quote = "" if letter == quote else quote or letter
        else:
            depth += (letter in "[{") - (letter in "]}")
        if letter == "," and not depth and not quote:
            parts.append("")
        else:
            parts[-1] += letter
    return parts


def _case(table: Any, complete: Any, varied: Mapping[str, Any]) -> DesignPoint:
    scene, before, error = None, None, ""
    scales = {key: x for key, x in varied.items() if key.rpartition(".")[2] in SCALES}
    plain = {key: x for key, x in varied.items() if key not in scales}
    changed = _changed(table, complete, plain)
    try:
        text = tomli_w.dumps(changed)
        before = loads(text)
        scene = scaled(before, scales)
        text = dumps(scene)
    except ValueError as refused:
        error = str(refused)
    keys = _flat(without_spreads(tomllib.loads(text))[0])
    for key, value in varied.items():  # a name for a number, as of a depth, is that number
        keys[key] = keys[key] if isinstance(keys.get(key), float) else _plain(value)
    return DesignPoint(
        varied=varied, keys=keys, text=text, scene=scene, before=before, error=error
    )  # fmt: skip


def _changed(table: Any, complete: Any, varied: Mapping[str, Any]) -> Any:
    """A copy of a table with other values of its keys; the body first, then what is in it."""
    for key in sorted(varied, key=lambda key: key != BODY):
        if key == BODY:
            table = table | {BODY: _body(varied[key])}
        else:
            table = _with(table, complete, key.split("."), varied[key])
    return table


def _body(name: Any) -> Any:
    """The table of a preset, or of a file."""
    if name in BODIES:
        scene = with_body(loads(""), BODIES[name])
        return tomllib.loads(dumps(scene))[BODY]
    if not Path(str(name)).is_file():
        raise ValueError(
            f"body '{name}' is no file and none of {', '.join(BODIES)}; name one of these or a file"
        )
    return {"kind": "mesh", "file": str(Path(name).resolve())}


def _with(node: Any, complete: Any, path: Sequence[str], value: Any) -> Any:
    """A copy of a table in which what a path leads to has another value."""
    if not path:
        return value
    head, rest = path[0], path[1:]
    if isinstance(node, list):
        if not (head.isdecimal() and int(head) < len(node)):
            raise ValueError(f"there is no '{head}' in a list of {len(node)}; count from 0")
        k = int(head)
        return [*node[:k], _with(node[k], None, rest, value), *node[k + 1 :]]
    if isinstance(node, str):  # a preset's name stands for its table
        choose("material", node, list(PRESETS))
        node = write_material(solid_of(node))
    if not isinstance(node, dict):
        raise ValueError(f"there is no '{head}' in {node!r}; vary the whole value")
    before = complete.get(head) if isinstance(complete, dict) else None
    inner = node.get(head, before if rest and before is not None else {})
    return with_key(node, head, _with(inner, before, rest, value))


def _flat(table: Mapping[str, Any]) -> dict[str, float | str]:
    """Keys with their section, and values that fit one entry of a table."""
    found: dict[str, float | str] = {}
    for section, values in table.items():
        if isinstance(values, dict):
            found |= {f"{section}.{key}": _plain(value) for key, value in values.items()}
    return found


def _plain(value: Any) -> float | str:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    return value if isinstance(value, str) else json.dumps(value)


def _refuse_words(found: Sequence[DesignPoint]) -> None:
    """Numbers may be out of range in some runs; a word that no run can use is a slip."""
    if all(case.error for case in found):
        raise ValueError(f"no combination makes a scene: {found[0].error}")
    accepted = {(k, str(v)) for case in found if not case.error for k, v in case.varied.items()}
    for case in found:
        for key, value in case.varied.items():
            if not isinstance(value, int | float) and (key, str(value)) not in accepted:
                raise ValueError(f"{key} = {value}: {case.error}")


def _content(file: str) -> bytes:
    with reading.opened(file) as opened:
        return hashlib.file_digest(opened, "sha256").digest()  # type: ignore[arg-type]
