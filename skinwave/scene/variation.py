"""Design of a sweep: keys of a scene file, their values, and how they are combined."""

import hashlib
import itertools
import json
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from meshes import reading
from simple_model.choices import choose
from skinwave.scene.distributions import Spread, parse_distribution, uniform
from skinwave.scene.dotted_keys import materials_of, with_materials, with_value
from skinwave.scene.file import (
    DEEPEST,
    dumps,
    from_table,
    loads,
    parse_toml,
    read,
    to_table,
    without_spreads,
)
from skinwave.scene.key_hints import key_hint
from skinwave.scene.keys import SCALES, SECTIONS
from skinwave.scene.scene import BODIES, Scene, solid_of, with_body
from skinwave.scene.spreads import PRESSURE
from skinwave.system.plain_text import number_in
from skinwave.typing import Floats

DESIGNS = ("factorial", "zip", "lhs", "sobol")
SAMPLED = ("lhs", "sobol")  # designs with --samples
MOST_RUNS = 100_000


@dataclass(frozen=True, kw_only=True)
class Choice:
    """A key of a scene file and its `values`."""

    key: str
    values: tuple[Any, ...]

    def at(self, shares: Floats) -> list[Any]:
        """Return the values at shares (n,) from 0 to 1 of the list."""
        last = len(self.values) - 1
        return [self.values[min(int(share * len(self.values)), last)] for share in shares]


Variation = Choice | Spread


@dataclass(frozen=True, kw_only=True)
class DesignPoint:
    """One run of a sweep: its `varied` keys and the scene, or an `error` instead.

    `text` is that of the scene's file. `before` is the scene before its materials are scaled.
    """

    varied: Mapping[str, Any]
    text: str
    scene: Scene | None = None
    before: Scene | None = None
    error: str = ""

    @property
    def keys(self) -> dict[str, float | str]:
        """Keys of the scene's file, with their section, and their values as cells of a table."""
        keys = _flat(without_spreads(tomllib.loads(self.text))[0])
        for key, value in self.varied.items():  # words for numbers, such as depths, become numbers
            keys[key] = keys[key] if isinstance(keys.get(key), float) else _plain(value)
        return keys

    def name(self, *model_options: object) -> str:
        """Return a hash of the complete scene, its files and the solver options."""
        digest = hashlib.sha256(repr((self.text, *model_options)).encode())
        for name in self.scene.files if self.scene else ():
            with reading.open_regular(name) as file:
                digest.update(hashlib.file_digest(file, "sha256").digest())  # type: ignore[arg-type]
        return digest.hexdigest()[:24]


def parse(text: str) -> Variation:
    """Return the variation of `key=v1,v2`, `key=start:stop:n`, or a distribution.

    A distribution is `key=start:stop`, uniform between limits, or such as `key=normal(25e3,0.3)`.
    """
    key, equals, right = text.partition("=")
    key = _checked_key(key.strip())
    if not equals or not right.strip():
        raise ValueError(f"--vary {text} needs values; write {key}=v1,v2 or {key}=start:stop:n")
    if spread := parse_distribution(key, right):
        return spread
    numbers = [number_in(part) for part in right.split(":")]
    if len(numbers) == 1 or None in numbers:
        return Choice(key=key, values=tuple(_values(right)))
    if len(numbers) > 3 or not all(math.isfinite(x) for x in numbers if x is not None):
        raise ValueError(f"--vary {text} is not valid; write three finite numbers, start:stop:n")
    start, stop, *count = (x for x in numbers if x is not None)
    if not count:
        return uniform(key, start, stop)
    if not (count[0] == int(count[0]) and 1 <= count[0] <= MOST_RUNS):
        raise ValueError(f"--vary {text} needs a whole number of values from 1 to {MOST_RUNS:,}")
    return Choice(key=key, values=tuple(np.linspace(start, stop, int(count[0])).tolist()))


def combinations(
    variations: Sequence[Variation],
    design: str = "factorial",
    samples: int | None = None,
    seed: int = 0,
) -> list[dict[str, Any]]:
    """Return the values of each run, by key.

    The design is "factorial", every value with every other; "zip", first with first; "lhs", a Latin
    hypercube of lists and distributions, reproducible by the seed (McKay et al., Technometrics
    21:239 (1979)); or "sobol", for Sobol' indices, with `samples` rows in each matrix.
    """
    choose("design", design, DESIGNS)
    keys = [variation.key for variation in variations]
    if not keys:
        raise ValueError("nothing is varied; give --vary key=v1,v2 at least once")
    if twice := [key for key in dict.fromkeys(keys) if keys.count(key) > 1]:
        raise ValueError(f"{twice[0]} is varied twice; give all its values in one --vary")
    if (samples is None) == (design in SAMPLED):
        raise ValueError(
            "--samples needs --design lhs or sobol, and these need --samples; give both or neither"
        )
    if design in SAMPLED:
        shares = _shares(len(keys), design, samples or 0, seed)
        drawn = [each.at(column) for each, column in zip(variations, shares.T, strict=True)]
        return [dict(zip(keys, met, strict=True)) for met in zip(*drawn, strict=True)]
    values = [each.values for each in variations if isinstance(each, Choice)]
    if spread := [each.key for each in variations if isinstance(each, Spread)]:
        raise ValueError(
            f"{spread[0]} has a distribution; use --design lhs or sobol with --samples, or give "
            "values (start:stop:n)"
        )
    lengths = [len(each) for each in values]
    if design == "zip" and len(set(lengths)) > 1:
        raise ValueError(f"--design zip needs lists of equal length, not {lengths}; use factorial")
    _check_count(lengths[0] if design == "zip" else math.prod(lengths))
    every = zip(*values, strict=True) if design == "zip" else itertools.product(*values)
    return [dict(zip(keys, each, strict=True)) for each in every]


def _shares(d: int, design: str, samples: int, seed: int) -> Floats:
    """Shares (n, d) from 0 to 1 of d keys in the runs of a sampled design."""
    from scipy.stats import qmc

    if design == "lhs":
        _check_count(samples)
        return np.asarray(qmc.LatinHypercube(d, rng=seed).random(samples))
    _check_count(samples * (d + 2))
    return saltelli_shares(d, samples, seed)


def saltelli_shares(d: int, n: int, seed: int = 0) -> Floats:
    """Return shares (n (d + 2), d) from 0 to 1 of d numbers, for Sobol' indices.

    These are matrices A and B of n rows, a power of two, then A with column k from B, for each k,
    of a scrambled Sobol' sequence in 2 d dimensions (Owen, J Complex 14:466 (1998); Saltelli et
    al., Comput Phys Commun 181:259 (2010), section 3).
    """
    from scipy.stats import qmc

    if n < 2 or n & (n - 1):
        near = 2 ** max(1, round(np.log2(max(n, 2))))
        raise ValueError(f"{n} samples of each matrix are not a power of two; use {near}")
    a, b = np.split(qmc.Sobol(2 * d, rng=seed).random(n), 2, axis=1)
    mixed = np.tile(a, (d, 1, 1))
    for k in range(d):
        mixed[k, :, k] = b[:, k]
    return np.vstack([a, b, *mixed])


def cases(path: Path, combined: Sequence[Mapping[str, Any]]) -> list[DesignPoint]:
    """Return the runs of a scene file for each combination of values, or their errors."""
    table = parse_toml(reading.read_text(path), path.parent)
    return cases_of(table, tomllib.loads(dumps(read(path))), combined)


def cases_of(table: Any, complete: Any, combined: Sequence[Mapping[str, Any]]) -> list[DesignPoint]:
    """Return the runs for the table of a scene file, and its complete table."""
    points = [_case(table, complete, each) for each in combined]
    _check_words(points)
    return points


def with_values(scene: Scene, values: Mapping[str, Any]) -> Scene:
    """Return a scene with other values of keys of its file; these keys then have no spread.

    Keys such as "body.material.modulus_scale" are factors on all moduli or losses of a material.
    """
    plain, scales = _split_scales(values)
    if plain.keys() == {PRESSURE}:  # works for scenes that no file can store
        pressure = replace(scene.pressure, peak_pressure=plain[PRESSURE])
        left = tuple(each for each in scene.spreads if each[0] != PRESSURE)
        scene = replace(scene, pressure=pressure, spreads=left)
    elif plain:
        complete = to_table(scene)
        scene = from_table(_change(complete, complete, plain))
    return _scale(scene, scales)


def _split_scales(values: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Values of keys of a file, and factors on moduli and losses."""
    scales = {key: x for key, x in values.items() if key.rpartition(".")[2] in SCALES}
    return {key: x for key, x in values.items() if key not in scales}, scales


def _scale(scene: Scene, scales: Mapping[str, Any]) -> Scene:
    """The scene with all moduli or losses of materials multiplied by factors."""
    if not scales:
        return scene
    materials, factors = materials_of(scene.body), dict[str, dict[str, float]]()
    for key, factor in scales.items():
        if isinstance(factor, bool) or not isinstance(factor, int | float) or not factor > 0:
            raise ValueError(f"{key} = {factor!r} must be a number above 0")
        place, _, scale = key.rpartition(".")
        if place not in materials:
            raise ValueError(f"the scene has no material for {key}; remove it")
        factors.setdefault(place, {})[SCALES[scale]] = float(factor)
    for place, own in factors.items():
        materials[place] = solid_of(materials[place]).scaled(**own)
    return replace(scene, body=with_materials(scene.body, materials))


def _check_count(count: int) -> None:
    if not 1 <= count <= MOST_RUNS:
        raise ValueError(f"the design has {count:,} runs; give values for 1 to {MOST_RUNS:,}")


def _checked_key(key: str) -> str:
    """Return a key of a scene; parts behind the second, as material.poisson, are not checked."""
    known = [f"{section}.{name}" for section, keys in SECTIONS.items() for name in keys]
    first = ".".join(key.split(".")[:2])
    if key != "body" and (key.count(".") > DEEPEST or first not in known):
        hint = key_hint(key, known) or "; write a key such as tacton.size_mm"
        raise ValueError(f"'{key[:60]}' is not a key of a scene{hint}")
    return key


def _values(text: str) -> list[Any]:
    """Values separated by commas, as in a scene file, or words without quotes."""
    try:
        return list(parse_toml(f"values = [{text}]")["values"])
    except ValueError:
        parts = [part.strip() for part in text.split(",")]
        numbers = list(map(number_in, parts))
        return [part if x is None else x for part, x in zip(parts, numbers, strict=True)]


def _case(table: Any, complete: Any, varied: Mapping[str, Any]) -> DesignPoint:
    scene, before, error = None, None, ""
    plain, scales = _split_scales(varied)
    made = _change(table, complete, plain)
    try:
        text = tomli_w.dumps(made)
        before = loads(text)
        scene = _scale(before, scales)
        text = dumps(scene)
    except ValueError as refused:
        error = str(refused)
    return DesignPoint(varied=varied, text=text, scene=scene, before=before, error=error)


def _change(table: Any, complete: Any, varied: Mapping[str, Any]) -> Any:
    """A copy of a table with other values: first of the body, then of keys in it.

    The key "body" has the name of a preset or a file.
    """
    for key in sorted(varied, key=lambda key: key != "body"):
        if key == "body":
            table = table | {"body": _body(varied[key])}
        else:
            table = with_value(table, key.split("."), varied[key], complete)
    return table


def _body(name: Any) -> Any:
    """The table of a preset or of a file."""
    if name in BODIES:
        return to_table(with_body(loads(""), BODIES[name]))["body"]
    if not Path(str(name)).is_file():
        raise ValueError(
            f"body '{name}' is neither a file nor one of {', '.join(BODIES)}; use one of these "
            "or a file"
        )
    return {"kind": "mesh", "file": str(Path(name).resolve())}


def _flat(table: Mapping[str, Any]) -> dict[str, float | str]:
    """Keys with their section, and values for cells of a table."""
    return {
        f"{section}.{key}": _plain(value)
        for section, values in table.items()
        if isinstance(values, dict)
        for key, value in values.items()
    }


def _plain(value: Any) -> float | str:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    return value if isinstance(value, str) else json.dumps(value)


def _check_words(points: Sequence[DesignPoint]) -> None:
    """Refuse words that are not valid in any run. Numbers may be out of range in some runs."""
    if all(case.error for case in points):
        raise ValueError(f"no combination gives a valid scene: {points[0].error}")
    accepted = {(k, str(v)) for case in points if not case.error for k, v in case.varied.items()}
    for case in points:
        for key, value in case.varied.items():
            if not isinstance(value, int | float) and (key, str(value)) not in accepted:
                raise ValueError(f"{key} = {value}: {case.error}")
