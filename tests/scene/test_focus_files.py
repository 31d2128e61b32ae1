"""Focal spots from maps of pressure: files, units and statistics, and the answer of every model."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from meshes import cache
from simple_model import MovingPressure, Tacton, Trajectory
from simple_model.load.focus import GAUSSIAN_WIDTH as W
from simple_model.load.spot_map import spot_map
from skinwave import Body, Scene, dumps, loads, read
from skinwave.commands.cli import main
from skinwave.models.options import SolveOptions
from skinwave.planning.plan import plan
from skinwave.planning.simulate import compute
from skinwave.scene.focus_file import focus_note, read_spot
from skinwave.scene.variation import cases

LINE = np.arange(-20.0, 21.0) + 0.3  # mm; the focus lies between samples, and off the middle
X, Y = np.meshgrid(LINE, LINE - 2.0, indexing="ij")
RMS = 2000 * np.exp(-(X**2 + Y**2) / (4e6 * W**2))  # Pa; its square is the built-in Gaussian
PEAK = 2 * 2000**2 / (1.2 * 343**2)  # Pa, on a wall that reflects fully
PHASE = np.exp(1j * X)


def table(names, *columns, separator=","):
    rows = np.column_stack([np.ravel(each) for each in (X, Y, *columns)])
    lines = [separator.join(f"{value:.9g}" for value in row) for row in rows]
    return "\n".join([names, *lines])


def write_image(path):
    """A VTK image by hand, in ASCII: x runs fastest."""
    values = " ".join(f"{value:.9g}" for value in (2**0.5 * RMS).T.ravel())
    path.write_text(
        '<VTKFile type="ImageData" version="0.1"><ImageData WholeExtent="0 40 0 40 0 0" '
        f'Origin="{X.min()} {Y.min()} 200" Spacing="1 1 1"><Piece Extent="0 40 0 40 0 0">'
        f'<PointData><DataArray type="Float64" Name="p_amplitude (Pa)" format="ascii">{values}'
        "</DataArray></PointData></Piece></ImageData></VTKFile>"
    )


def comma(text):
    return text.replace(",", ";").replace(".", ",")


WRITERS = {
    "rms.csv": lambda path: path.write_text(table("x [mm],y [mm],p_rms [Pa]", RMS)),
    "excel.csv": lambda path: path.write_text(
        comma(table("x [mm],y [mm],p_eff [kPa]", RMS / 1e3)), encoding="utf-16"
    ),
    "comsol.txt": lambda path: path.write_text(
        "% Model: array\n" + table("% x (mm)   y (mm)   Re(p) (Pa)   Im(p) (Pa)",
        2**0.5 * RMS * PHASE.real, 2**0.5 * RMS * PHASE.imag, separator="   ")
    ),
    "complex.csv": lambda path: path.write_text("\n".join(["x [mm],y [mm],p (Pa)", *(
        f"{x},{y},{z.real:.9g}{z.imag:+.9g}i"
        for x, y, z in zip(X.flat, Y.flat, (2**0.5 * RMS * PHASE).flat, strict=True))])),
    "level.tsv": lambda path: path.write_text(
        table("x_mm\ty_mm\tspl [dB re 20 µPa]", 20 * np.log10(RMS / 20e-6), separator="\t")
    ),
    "intensity.csv": lambda path: path.write_text(
        table("x_mm y_mm intensity_w_m2", RMS**2 / (1.2 * 343), separator=" ")
    ),
    "force.csv": lambda path: path.write_text(
        table("x [mm],y [mm],radiation pressure [N/m²]", PEAK * (RMS / 2000) ** 2)
    ),
    "complex.npz": lambda path: np.savez(
        path, x_mm=LINE[:-1], y_mm=LINE - 2.0, p_pa=(2**0.5 * RMS * PHASE)[:-1].T
    ),
    "scan.vti": write_image,
}  # fmt: skip


@pytest.mark.parametrize("name", WRITERS)
def test_files_give_spot_and_pressure_of_the_focus(name, tmp_path):
    if name.endswith(".vti"):
        pytest.importorskip("pyvista")
    WRITERS[name](tmp_path / name)
    spot = read_spot(tmp_path / name, "mm" * name.endswith(".vti"), needs_peak=True)
    assert spot.error < 1e-3
    assert spot.peak == pytest.approx(PEAK, rel=spot.error)
    at = np.random.default_rng(0).uniform(-0.015, 0.015, (500, 2))
    exact = np.exp(-(at**2).sum(axis=1) / (2 * W**2))
    assert np.abs(spot(at) - exact).max() < spot.error
    assert spot(np.array([0.03, 0.0])) == 0
    assert spot.area == pytest.approx(2 * np.pi * W**2, rel=1e-3)
    assert spot.half_widths == pytest.approx([2 * np.sqrt(2 * np.log(2)) * W] * 2, rel=1e-3)


SCENE = """
[tacton]
am_frequency_hz = 140
duration_s = 0.03
shape = "circle"
size_mm = 8
speed_m_per_s = 4
FOCUS
[body]
BODY
[probes]
points_mm = [[0, 0], [4, 1]]
"""
MAP = """[focus]
profile = "file"
file = "rms.csv"
"""
SLAB = """kind = "slab"
size_x_mm = 24
size_y_mm = 24
thickness_mm = 8
sides = "clamped"
"""
SHEET = """preset = "paper-sheet"
air = false
"""
SMALL_SHEET = """preset = "paper-sheet"
air = false
size_x_mm = 40
size_y_mm = 40
"""
MODELS = {
    "point-kernel": 'kind = "none"', "flat-body": 'preset = "skin-slab"',
    "flat-body-harmonic": 'preset = "skin-slab"', "plate-modes": SHEET,
    "plate-modes-transient": SHEET, "plate-modes-nonlinear": SHEET, "fem": SLAB,
    "fem-harmonic": SLAB, "fem-transient": SLAB, "fem-nonlinear": SMALL_SHEET,
    "fem-nonlinear-transient": SMALL_SHEET,
}  # fmt: skip


def scene_of(body, focus, folder, seconds=0.03):
    path = folder / "scene.toml"
    text = SCENE.replace("FOCUS", focus).replace("BODY", body)
    path.write_text(text.replace("0.03", f"{seconds:g}"))
    return read(path)


@pytest.mark.parametrize("model", MODELS)
def test_every_model_answers_to_the_map_of_a_gaussian_as_to_the_gaussian(model, tmp_path):
    WRITERS["rms.csv"](tmp_path / "rms.csv")
    seconds = 0.002 if model == "fem-nonlinear-transient" else 0.03
    of_map = scene_of(MODELS[model], MAP, tmp_path, seconds)
    peak = f"[focus]\npeak_pressure_pa = {of_map.pressure.peak_pressure!r}"
    own = scene_of(MODELS[model], peak, tmp_path, seconds)
    options = {"h": 4e-3} if model.startswith("fem") else {}
    a, b = (compute(each, model, **options).values for each in (of_map, own))
    assert np.abs(a - b).max() < of_map.pressure.profile.error * np.abs(b).max()


@pytest.mark.parametrize("body", [MODELS["flat-body"], "kind = 'none'"])
def test_a_plan_states_the_error_of_a_map(body, tmp_path):
    WRITERS["rms.csv"](tmp_path / "rms.csv")
    scene = scene_of(body, MAP, tmp_path)
    parts = {part.name: part.error for part in plan(scene).statement.parts}
    assert parts["focus"] == scene.pressure.profile.error > 1e-5


@pytest.mark.parametrize("quantity", ["displacement", "displacement_x"])
@pytest.mark.parametrize("model", ["flat-body", "flat-body-harmonic"])
def test_wavenumber_integrals_take_spots_without_symmetry(model, quantity):
    """A Gaussian with a side lobe moves a probe as each of both would."""
    apart, shares = 0.022 * np.array([0.8, 0.6]), {0: 1.0, 1: 0.4}
    line = np.linspace(-0.04, 0.04, 161)
    places = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1)
    both = sum(
        share * np.exp(-((places - k * apart) ** 2).sum(axis=-1) / (2 * W**2))
        for k, share in shares.items()
    )
    spot = spot_map(line, line, both)
    tacton = Tacton(am_frequency=140, duration=0.03, trajectory=Trajectory(
        shape="circle", size=0.01, speed=6.0))  # fmt: skip
    probes = np.array([[0.0, 0.0], [0.012, 0.004], [-0.003, 0.01]])

    def motion(probes, profile):
        pressure = MovingPressure(tacton=tacton, profile=profile)
        scene = Scene(pressure=pressure, body=Body(), quantity=quantity,
                      probes=tuple(map(tuple, probes.tolist())))  # fmt: skip
        return compute(scene, model).values

    exact = sum(share * motion(probes - k * apart, "gaussian") for k, share in shares.items())
    found = motion(probes, spot)
    assert np.abs(found - exact).max() < 1e-3 * np.abs(exact).max()
    assert np.abs(motion(probes, "gaussian") - exact).max() > 0.1 * np.abs(exact).max()


def test_a_scene_with_a_map_is_written_and_known_by_its_numbers(tmp_path):
    WRITERS["rms.csv"](tmp_path / "rms.csv")
    scene = scene_of('preset = "skin-slab"', MAP, tmp_path)
    assert scene.pressure.peak_pressure == pytest.approx(PEAK, rel=1e-3)
    assert loads(dumps(scene)) == scene
    assert scene.files == (str(tmp_path / "rms.csv"),)
    assert f"{2e3 * np.sqrt(2 * np.log(2)) * W:.3g} mm by" in focus_note(scene.pressure)
    assert plan(scene, SolveOptions(model="auto")).model == "flat-body"
    given = scene_of('preset = "skin-slab"', MAP + "peak_pressure_pa = 20", tmp_path)
    assert given.pressure.peak_pressure == 20
    force = 1e3 * 20 * 2 * np.pi * W**2
    assert f"{force:.3g} mN at 20 Pa (the file gives 56.7 Pa)" in focus_note(given.pressure)
    [before] = cases(tmp_path / "scene.toml", [{}])
    (tmp_path / "rms.csv").write_text(table("x [mm],y [mm],p_rms [Pa]", RMS**1.1))
    [after] = cases(tmp_path / "scene.toml", [{}])
    assert before.text == after.text
    assert after.scene != before.scene
    assert cache.digest(after.scene.pressure) != cache.digest(before.scene.pressure)


def test_a_map_without_a_unit_of_pressure_keeps_the_peak_of_the_scene(tmp_path):
    relative = 20 * np.log10(RMS / RMS.max())
    for name, values in (("p [mV]", RMS / 7), ("level [dB]", relative), ("spl [dB]", relative)):
        (tmp_path / "rms.csv").write_text(table(f"x [mm],y [mm],{name}", values))
        scene = scene_of('preset = "skin-slab"', MAP, tmp_path)
        assert scene.pressure.peak_pressure == MovingPressure.peak_pressure
        assert scene.pressure.profile(np.array([W, 0.0])) == pytest.approx(np.exp(-0.5), abs=1e-3)


def cut(half):
    rows = table("x [mm],y [mm],p_rms [Pa]", RMS).split("\n")
    return "\n".join(rows[:1] + [row for row, x in zip(rows[1:], X.ravel(), strict=True)
                                 if abs(x) < half])  # fmt: skip


NAMES = "x [mm],y [mm],p_rms [Pa]"
REFUSED = {
    "on the border of the map is 42 %": cut(6.5),
    "interpolation errs by": "\n".join(
        [NAMES, *(f"{x},{y},{np.exp(-((x - 16)**2 + (y - 16)**2) / 60)}"
                  for x in range(0, 40, 5) for y in range(0, 40, 5))]
    ),
    "RMS value or an amplitude": table("x [mm],y [mm],p [Pa]", RMS),
    "negative values, as at one instant": table(NAMES, RMS * PHASE.real),
    "no complete grid": table(NAMES, RMS).rsplit("\n", 1)[0],
    "not finite numbers": table(NAMES, np.where(np.hypot(X, Y) < 1, np.nan, RMS)),
    "x has no unit": table("x,y [mm],p_rms [Pa]", RMS),
    "'furlong' is not a unit of length": table("x [furlong],y [mm],p_rms [Pa]", RMS),
    "no header above its numbers": table(NAMES, RMS).split("\n", 1)[1],
    "no column has a known name": table("x [mm],y [mm],v [Pa]", RMS),
    "2 columns hold the sound pressure": table(NAMES + ",p_rms_pa", RMS, RMS),
    "0 columns hold the imaginary part": table("x [mm],y [mm],Re(p) [Pa]", RMS),
    "several values of z": table("x [mm],y [mm],z [mm],p_rms [Pa]", X + Y, RMS),
    "line 4 has 2 cells instead of 3": table(NAMES, RMS).replace("\n", "\n1,2\n").replace(
        "\n1,2\n", "\n", 2),
    "41 x 1 samples": "\n".join([NAMES, *(f"{x},0,{np.exp(-x**2 / 60)}" for x in LINE)]),
    "some of them above 0": table(NAMES, 0 * RMS),
}  # fmt: skip


@pytest.mark.parametrize("said", REFUSED)
def test_what_is_no_map_of_a_focus_is_refused(said, tmp_path, capsys):
    (tmp_path / "rms.csv").write_text(REFUSED[said])
    with pytest.raises(ValueError, match=said) as error:
        scene_of('preset = "skin-slab"', MAP, tmp_path)
    assert "\n" not in str(error.value)
    assert main(["plan", str(tmp_path / "scene.toml")]) == 2
    assert "rms.csv" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("focus", "said"),
    [
        (MAP + "height_mm = 150", "height_mm does not apply"),
        (MAP + 'unit = "mm"', "remove that"),
        (MAP.replace('file = "rms.csv"', ""), "without file"),
        (MAP.replace("rms.csv", "missing.csv"), "missing.csv: cannot be read"),
        (MAP.replace("rms.csv", "half.vti"), "is damaged"),
        (MAP.replace("rms.csv", "square.npz"), "which axis is which"),
        ('[focus]\nfile = "rms.csv"', 'set profile = "file" too'),
        ('[focus]\nprofile = "files"', "did you mean 'file'"),
    ],
)
def test_keys_that_do_not_fit_are_refused(focus, said, tmp_path):
    WRITERS["rms.csv"](tmp_path / "rms.csv")
    np.savez(tmp_path / "square.npz", x_mm=LINE, y_mm=LINE - 2, p_rms_pa=RMS)
    write_image(tmp_path / "whole.vti")
    whole = Path(tmp_path / "whole.vti").read_bytes()
    (tmp_path / "half.vti").write_bytes(whole[: len(whole) // 2])
    if "half.vti" in focus:
        pytest.importorskip("pyvista")
    with pytest.raises(ValueError, match=re.escape(said)):
        scene_of('preset = "skin-slab"', focus, tmp_path)


def test_what_needs_a_spot_of_the_array_says_so(tmp_path, capsys):
    WRITERS["rms.csv"](tmp_path / "rms.csv")
    scene_of('preset = "skin-slab"', MAP, tmp_path)
    assert main(["live", str(tmp_path / "scene.toml"), "--out", str(tmp_path / "l.html")]) == 2
    assert "no control for the focus profile 'file'" in capsys.readouterr().err
    assert main(["relax", str(tmp_path / "scene.toml"), "--out", str(tmp_path / "r")]) == 2
    assert "relax compares focal spots of the array" in capsys.readouterr().err
    assert not (tmp_path / "l.html").exists()


def test_a_focus_becomes_weaker_above_its_plane_as_its_width_says(tmp_path):
    """Half as wide a spot has a quarter of the depth."""
    line = np.linspace(-0.02, 0.02, 81)
    squares = np.add.outer(line**2, line**2)
    load = MovingPressure(tacton=Tacton())
    narrow = replace(load, profile=spot_map(line, line, np.exp(-2 * squares / W**2)))
    above = np.array([[0.0, 0.0, 0.008]])
    own = load.spot(np.array([[0.0, 0.0, 0.032]]), np.zeros(2))
    assert narrow.spot(above, np.zeros(2)) == pytest.approx(own, rel=1e-2)
