"""Records draw and convert themselves: responses, meshes, fields, scenes, plans, sweeps."""

import gc
import re
import sys
from dataclasses import replace
from importlib.util import find_spec
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from legible import illegible, sizes
from PIL import Image

import meshes
import skinwave
from fem.stress import nodal_strain, solid_parts
from simple_model import (
    Effort,
    ErrorPart,
    MovingPressure,
    Response,
    Statement,
    Tacton,
    Trajectory,
    phasors,
)
from simple_model.load.focus import spot_width
from skinwave.planning.record import PlanRow
from skinwave.planning.simulate import compute
from skinwave.report import films
from skinwave.report.renderer import renderer  # noqa: F401, in the condition below
from skinwave.report.styles import style
from skinwave.results import citations
from skinwave.results.motion import probe_response
from skinwave.scene.scene import Layer
from skinwave.sweeps.in_python import SweepTable

# What is tested here is not how accurate a model is.
pytestmark = pytest.mark.filterwarnings("ignore::skinwave.SkinwaveWarning")
draws = pytest.mark.skipif("not renderer().is_available", reason="nothing draws solids here")
ROOT = Path(__file__).parents[2]
RATE = 10_000.0
MESH = ErrorPart(name="mesh", source="elements of 3 mm", error=0.03, cure="use smaller elements")
PLACES = np.array([[0.0, 0.0], [0.1 / 3, -0.02]])


@pytest.fixture(autouse=True)
def closed_figures():
    mpl.use("Agg")
    yield
    import matplotlib.pyplot as plt

    plt.close("all")


@pytest.fixture(scope="module")
def scene():
    path = Trajectory(shape="circle", size=0.02, speed=4.0)
    load = MovingPressure(tacton=Tacton(am_frequency=100, duration=0.1, trajectory=path))
    probes = ((0.0, 0.0), (0.01, 0.0), (0.025, 0.005))
    return skinwave.Scene(name="disc <b>", pressure=load, body=skinwave.Body(), probes=probes)


def wave(frequency=130.0, quantity="displacement", n=1000, warnings=("too <coarse>",)):
    times = np.arange(n) / RATE
    x = 3e-6 * np.sin(2 * np.pi * frequency * times)
    return Response(
        model="made", times=times, probes=PLACES, values=np.column_stack([x, x / 2]),
        quantity=quantity, effort=Effort(warnings=warnings, errors=Statement(parts=(MESH,))),
    )  # fmt: skip


def test_to_xarray_has_units_and_is_written_to_netcdf(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ImportError, match="pip install xarray"):
        wave().to_xarray()
    monkeypatch.undo()
    xarray = pytest.importorskip("xarray")
    response = wave(quantity="strain_xz")
    response.to_xarray().to_netcdf(tmp_path / "wave.nc", engine="scipy")
    with xarray.open_dataarray(tmp_path / "wave.nc", engine="scipy") as read:
        assert read.dims == ("time", "probe")
        assert np.array_equal(read.values, response.values)
        assert np.array_equal(read["time"], response.times)
        assert np.array_equal(np.column_stack([read["x"], read["y"]]), PLACES)
        assert [read[name].units for name in ("time", "x", "y")] == ["s", "m", "m"]
        assert read.name == read.quantity == "strain_xz"
        assert (read.units, read.long_name, read.model) == ("1", "strain xz", "made")
        assert (read.expected_error, read.warnings) == (0.03, "too <coarse>")


def test_to_dataframe_has_values_probes_and_units(monkeypatch):
    table = wave(quantity="strain_xz").to_dataframe()
    assert table.index.name == "time_s"
    assert table.columns.names == ["x_m", "y_m"]
    assert (table.attrs["units"], table.attrs["expected_error"]) == ("1", 0.03)
    assert np.array_equal(table.to_numpy(), wave().values)
    assert np.array_equal(table.columns.to_list(), PLACES)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match="pip install pandas"):
        wave().to_dataframe()
    for response, name in ((wave(quantity="acceleration"), "displacement"), (wave(), "lines")):
        with pytest.raises(ValueError, match="values|unknown"):
            getattr(response, name)
        assert not hasattr(response, name)


def test_lines_of_a_response_are_complex_amplitudes_by_name(scene):
    still = replace(scene.tacton, trajectory=type(scene.tacton.trajectory)())
    rest = replace(scene, pressure=replace(scene.pressure, tacton=still))
    found = skinwave.simulate(rest, "point-kernel", 0.999)
    lines = found.lines
    assert lines.names == ("f_AM", "2f_AM")
    # p0 sin^2 = p0 (1 - cos 2 w t) / 2, over whole periods: a sum without any window.
    t, x = found.times, found.values
    by_sum = 2 * np.exp(-2j * np.pi * 200 * t) @ x / len(t)
    assert lines["2f_AM"] == pytest.approx(by_sum, rel=1e-6)
    assert np.array_equal(lines.amplitudes, phasors(found, lines.frequencies))
    with pytest.raises(ValueError, match="line 'f_D' is unknown"):
        lines["f_D"]


def test_plots_of_responses_have_values_and_units():
    found = wave()
    ax = found.plot()
    assert ax.lines[1].get_xdata() * 1e-3 == pytest.approx(found.times)
    assert ax.lines[1].get_ydata() * 1e-6 == pytest.approx(found.values[:, 1])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time, ms", "displacement into the body, µm")
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["(0, 0)", "(33.33, -20)"]
    ax = found.spectrum().plot()
    assert ax.lines[0].get_xdata()[np.argmax(ax.lines[0].get_ydata())] == 130
    assert ax.lines[0].get_ydata().max() == pytest.approx(3)
    assert ax.get_ylabel() == "amplitude, µm"
    assert wave(quantity="strain_xx").plot().get_ylabel() == "strain xx, µm/m"


def test_to_pyvista_keeps_the_mesh():
    mesh = meshes.block((2e-3, 2e-3, 1e-3), 1e-3, order=1)
    mesh = meshes.quadratic(replace(mesh, region=np.arange(len(mesh.tets))))
    grid = mesh.to_pyvista()
    assert set(grid.celltypes) == {24}
    assert grid.volume == pytest.approx(4e-9)
    assert np.array_equal(grid.cells_dict[24], mesh.tets)
    assert np.array_equal(grid.cell_data["region"], mesh.region)
    assert np.array_equal(grid.field_data["facets:top"], mesh.facets["top"])


@pytest.fixture(scope="module")
def small(scene):
    path = Trajectory(shape="circle", size=0.008, speed=5.0)
    tacton = replace(scene.tacton, trajectory=path, duration=0.05)
    body = replace(scene.body, width=0.024, height=0.02, depth=0.006, sides="clamped")
    pressure = replace(scene.pressure, tacton=tacton)
    return replace(scene, pressure=pressure, body=body, probes=((0.0, 0.0), (0.004, 0.0)))


@pytest.fixture(scope="module")
def field(small):
    return skinwave.field(small, 5e-3 + np.arange(9) * 1e-3, 0.2, h=3e-3)


def test_a_field_at_a_time_has_its_displacement(field):
    grid = field.to_pyvista(0.0082)
    assert np.array_equal(grid["displacement"], field.displacement[3])
    assert grid.field_data["time_s"][0] == 0.008
    assert np.array_equal(grid.cells_dict[24], field.mesh.tets)
    shown = [grid.field_data["time_s"][0] for grid in field.grids([0.006, 0.013])]
    assert shown == [field.times[1], field.times[8]]
    for time in (0.004, 0.014):
        with pytest.raises(ValueError, match="outside"):
            field.to_pyvista(time)


def test_a_field_has_the_motion_of_probes_and_its_rate(field, small):
    nodes = np.unique(field.mesh.facets["top"])[::40]
    places = tuple(map(tuple, field.mesh.points[nodes, :2].tolist()))
    sampled = probe_response(replace(small, probes=places), field.moved)  # every 0.1 ms from 0
    read = np.searchsorted(sampled.times, field.times - 1e-9)
    assert -field.displacement[:, nodes, 2] == pytest.approx(sampled.values[read], abs=1e-12)
    for time, grid in zip(field.times, field.grids(), strict=True):
        near = replace(field, times=np.array([time - 1e-6, time + 1e-6])).displacement
        rate, velocity = (near[1] - near[0]) / 2e-6, grid["velocity"]
        assert np.abs(velocity - rate).max() < 1e-3 * np.abs(rate).max()


def test_strain_of_a_field_is_the_gradient_of_its_displacement(field):
    grid, x = field.to_pyvista(), field.mesh.points
    inner = (np.abs(x + [0, 0, 0.003]) < [0.008, 0.006, 0.002]).all(axis=1)
    slopes = grid.compute_derivative("displacement")["gradient"].reshape(-1, 3, 3)[inner]
    pairs = ([0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2])  # XX, YY, ZZ, XY, YZ, XZ
    gradient = ((slopes + slopes.swapaxes(1, 2)) / 2)[:, *pairs]
    for own, other in zip(grid["strain"][inner].T, gradient.T, strict=True):  # of one element each
        assert np.linalg.norm(own - other) < 0.2 * np.linalg.norm(own)
    # Displacements A x, times the first coordinate of the motion.
    A = np.arange(9.0).reshape(3, 3) ** 2
    affine = np.zeros_like(field.moved.basis)
    affine[:, 0] = (x @ A.T).ravel()
    grid = replace(field, moved=replace(field.moved, basis=affine)).to_pyvista()
    amount = grid["displacement"][0] @ x[0] / (x[0] @ A.T @ x[0])
    expected = amount * ((A + A.T) / 2)[pairs]
    assert grid["strain"] == pytest.approx(np.tile(expected, (len(x), 1)), rel=1e-6)


def test_strain_at_an_interface_is_the_mean_and_a_sheet_has_none(small):
    layers = (Layer(thickness=3e-3, material="palm-stiff"),)
    layered = replace(small, body=replace(small.body, layers=layers))
    field = skinwave.field(layered, [0.01], 0.5, h=4e-3)
    each = np.full((2, len(field.mesh.points), 6), np.nan)
    for k, part in enumerate(solid_parts(field.mesh, field.moved.build.material)):
        each[k, part.nodes] = nodal_strain(part, field.displacement.reshape(1, -1).T)[..., 0]
    jump = np.linalg.norm(each[1] - each[0], axis=1)
    assert np.nanmax(jump) > 0.1 * np.nanmax(np.abs(each))
    expected = np.nanmean(each, axis=0)[:, [0, 1, 2, 3, 5, 4]]
    assert field.to_pyvista()["strain"] == pytest.approx(expected, rel=1e-6, abs=1e-12)
    sheet = replace(small, body=replace(skinwave.BODIES["paper-sheet"], width=0.03, height=0.03))
    grid = skinwave.field(sheet, [0.01], 0.5, h=7e-3).to_pyvista()
    assert set(grid.point_data) == {"displacement", "velocity", "pressure"}


def test_pressure_of_a_field_is_the_moving_pressure(field, small):
    top = np.zeros(len(field.mesh.points), bool)
    top[field.mesh.facets["top"]] = True
    for time, grid in zip(field.times, field.grids(), strict=True):
        expected = small.pressure(field.mesh.points[top, :2], time)
        assert grid["pressure"][top] == pytest.approx(expected)
        assert not grid["pressure"][~top].any()
    assert expected.max() > 10


def test_paraview_reads_what_a_field_saves(field, tmp_path):
    import pyvista as pv

    path = field.save(tmp_path / "wave.pvd")
    reader = pv.get_reader(path)
    assert reader.time_values == pytest.approx(field.times)
    for k, grid in enumerate(field.grids()):
        reader.set_active_time_value(reader.time_values[k])
        (read,) = reader.read()
        for name in ("displacement", "velocity", "strain", "pressure"):
            assert np.array_equal(read[name], grid[name]), name
        assert np.array_equal(read.points, grid.points)
    assert "velocity: m/s" in list(read.field_data["units"])
    for name in ("wave.pvd", "wave.vtk"):  # one that exists, and one of another format
        with pytest.raises(ValueError, match="wave"):
            field.save(tmp_path / name, frames=2)
    assert len(pv.get_reader(field.save(path, frames=2, overwrite=True)).time_values) == 2


@draws
def test_a_film_of_a_field_plays_in_a_notebook(field, tmp_path):
    shown = field.animate(frames=4)
    assert "data:image/gif;base64,R0lG" in shown._repr_html_()
    with Image.open(BytesIO(shown.data)) as gif:
        frames = [gif.seek(k) or np.asarray(gif.convert("RGB")) for k in range(gif.n_frames)]
    assert len(frames) == shown.frames == 4
    assert all(np.abs(a - 1.0 * b).max() > 50 for a, b in pairwise(frames))
    path = tmp_path / "wave.gif"
    assert field.animate(path, 4).data == path.read_bytes() == shown.data
    for call in ({"path": path}, {"path": tmp_path / "wave.avi"}, {"camera": "lop"}):
        with pytest.raises(ValueError, match=r"exists|must end in|tilted"):
            field.animate(**call)


@draws
@pytest.mark.skipif(not all(map(find_spec, films.ENCODER)), reason="the extra [film] is missing")
@pytest.mark.filterwarnings(  # imageio-ffmpeg leaves its encoder's pipe to the collector
    "ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"
)
def test_a_film_of_a_field_may_be_an_mp4(field, tmp_path):
    import imageio.v2 as imageio

    shown = field.animate(tmp_path / "wave.mp4", 3)
    with imageio.get_reader(tmp_path / "wave.mp4") as film:
        assert sum(1 for _ in film) == 3
    assert "data:video/mp4;base64," in shown._repr_html_()
    gc.collect()


def test_a_field_takes_size_and_error_of_a_response(field, small, monkeypatch):
    response = skinwave.simulate(small, "fem", 0.2, h=3e-3)
    monkeypatch.setattr("skinwave.report.fields.assess", None)  # solves another mesh
    found = skinwave.field(small, field.times, 0.2, response=response)
    assert np.array_equal(found.displacement, field.displacement)
    parts = {part.name: part.error for part in response.effort.errors.parts}
    assert {part.name for part in found.effort.errors.parts} == set(parts)
    assert parts["mesh"] == {p.name: p.error for p in found.effort.errors.parts}["mesh"]
    louder = replace(small, pressure=replace(small.pressure, peak_pressure=70.0))
    kernel = skinwave.simulate(small, "point-kernel", 0.9)
    for scene, given, h in (
        (louder, response, None), (small, kernel, None), (small, response, 2e-3),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=r"another load|linear elements|leave out h"):
            skinwave.field(scene, field.times, response=given, h=h)


@pytest.mark.parametrize("times", [[], [0.0, np.nan], [0.01, 0.0], [-0.01, 0.0], [0.0, 0.06]])
def test_times_of_a_field_ascend_within_the_tacton(field, small, times):
    with pytest.raises(ValueError, match="times"):
        replace(field, times=times)
    with pytest.raises(ValueError, match="times"):
        skinwave.field(small, times, 0.5, h=6e-3)


def test_plot_of_a_field_shows_the_upper_surface(field):
    ax = field.plot(0.007)
    image = ax.collections[0]
    top = np.unique(field.mesh.facets["top"])
    assert np.asarray(image.get_array()) == pytest.approx(-1e6 * field.displacement[2, top, 2])
    low, high = image.get_clim()
    assert -low == high == pytest.approx(1e6 * np.abs(field.displacement[:, top, 2]).max())


def test_a_scene_is_drawn_before_anything_is_solved(scene):
    two = replace(scene.tacton, foci=(0.0, 0.5))
    ax = replace(scene, pressure=replace(scene.pressure, tacton=two)).plot()
    by_name = {line.get_label(): line for line in ax.lines}
    assert 1e-3 * by_name["probes"].get_xydata() == pytest.approx(scene.probe_points)
    assert np.hypot(*by_name["path"].get_xydata().T) == pytest.approx(10.0)
    reach = 1e3 * spot_width(scene.pressure.height) * np.sqrt(2 * np.log(2))  # of a Gaussian
    for contour, centre in zip(ax.collections, (10.0, -10.0), strict=True):
        places = contour.get_paths()[0].vertices - [centre, 0.0]
        assert np.hypot(*places.T) == pytest.approx(reach, rel=2e-3)
    assert ax.patches[0].get_label() == "slab of 100 x 100 x 15 mm"
    assert not skinwave.loads("[body]\nkind = 'none'").plot().patches


def test_notebook_pages_have_figures_and_warnings_and_escape_text(scene):
    response = skinwave.simulate(scene, "point-kernel", 0.999)
    kernel = replace(response, model="<i>")
    agreement = skinwave.compare(kernel, response, (100.0,))
    row = PlanRow(what="model", value="fem", reason="as <than> said")
    plan = skinwave.Plan(model="fem", body=scene.body, symmetry="x", rows=(row,),
                         cautions=("less <than> asked",))  # fmt: skip
    for record in (scene, response, kernel, agreement, plan, wave(quantity="pressure")):
        page = record._repr_html_()
        assert ("data:image/png;base64," in page) == (record is not agreement)
        assert not any(mark in page for mark in ("<b>d", "<i>", "<than>", "<coarse>"))
    for record, text in ((scene, "disc &lt;b"), (plan, "less &lt;t"), (wave(), "too &lt;c")):
        assert text in record._repr_html_()


def test_records_have_a_short_repr(scene, field):
    response = skinwave.simulate(scene, "flat-body")
    table = SweepTable(rows=({"status": "done", "focus.height_mm": 200},), varied=("height",))
    agreement = skinwave.compare(response, response, (100.0,))
    for record in (scene, response, response.spectrum(), response.lines, skinwave.plan(scene),
                   agreement, field, field.mesh, table):  # fmt: skip
        assert repr(record) == str(record)
        assert len(repr(record)) < 260
        assert "array" not in repr(record)


def test_a_sweep_in_python_has_the_runs_of_each_scene(scene, tmp_path):
    short = replace(scene.pressure, tacton=replace(scene.tacton, duration=0.03))
    base = replace(scene, pressure=short)
    vary = {"tacton.speed_m_per_s": np.array([4.0, 6.0]), "focus.peak_pressure_pa": "20,-1"}
    table = skinwave.sweep(base, vary, model="flat-body-harmonic", folder=tmp_path / "kept")
    assert len(table) == 4
    assert len(table.failed) == 2
    assert "peak_pressure" in table.failed[0]
    rows = [row for row in table.rows if row["status"] == "done"]
    for row, speed in zip(rows, (4.0, 6.0), strict=True):
        path = replace(base.tacton.trajectory, speed=speed)
        load = replace(short, tacton=replace(base.tacton, trajectory=path), peak_pressure=20.0)
        found = compute(replace(base, pressure=load), "flat-body-harmonic")
        assert row["peak_um"] == pytest.approx(1e6 * np.abs(found.values).max(axis=0), rel=1e-6)
    assert table.to_dataframe()["tacton.speed_m_per_s"].tolist() == table["tacton.speed_m_per_s"]
    again = skinwave.sweep(base, vary, model="flat-body-harmonic", folder=tmp_path / "kept")
    assert again["seconds"] == table["seconds"]  # which were not run again
    assert table.plot("peak_um[1]").lines
    assert "<img" in table._repr_html_()
    with pytest.raises(ValueError, match=r"tacton\.sped"):
        skinwave.sweep(base, {"tacton.sped": [1]})


def test_citations_depend_on_models_and_solvers():
    found = skinwave.cite(replace(wave(), model="flat-body"), replace(wave(), model="point-kernel"))
    assert "flat-body (wavenumber integral), point-kernel" in found.sentence
    assert "Kausel" in found.references[2]
    assert "10.1145/3613905.3650981" in str(found)
    assert len(found.references) == 3
    text = (ROOT / "CITATION.cff").read_text()
    cited = dict(re.findall(r"(?m)^(version|date-released): (.*)", text))
    assert cited["version"] == citations.VERSION
    assert str(citations.RELEASED) == cited["date-released"][:4]
    effort = Effort(versions={"skinwave": citations.VERSION}, solver="pardiso")
    said = str(skinwave.cite(replace(wave(), model="fem-transient", effort=effort)))
    for name in (f"Version {citations.VERSION}, {citations.RELEASED}.", "Newmark", "PARDISO"):
        assert name in said
    assert "Kausel" not in said
    with pytest.raises(ValueError, match="unknown"):
        skinwave.cite(wave())


def test_times_are_a_part_of_the_whole_response(scene):
    whole = compute(scene, "flat-body")
    part = compute(scene, "flat-body", times=np.arange(1600, 1800) / 20_000)
    assert part.times[::2] == pytest.approx(whole.times[800:900])
    small = 1e-6 * np.abs(whole.values).max()
    assert part.values[::2] == pytest.approx(whole.values[800:900], abs=small)
    for times in ([0.0, 1e-3, 3e-3], [0.0, np.nan]):
        with pytest.raises(ValueError, match="times"):
            skinwave.simulate(scene, "point-kernel", times=times)


def test_progress_is_shown_on_request_only(scene, capsys):
    small = replace(scene, body=replace(scene.body, width=0.06, height=0.06, sides="clamped"))
    skinwave.simulate(small, "fem", 0.9, h=10e-3, progress=True)
    assert "lines" in capsys.readouterr().err.split("\n")
    skinwave.simulate(scene, "flat-body-harmonic", 0.9, progress=True)
    assert "wavenumber integral" in capsys.readouterr().err.split("\n")
    skinwave.simulate(scene, "point-kernel", 0.9)
    assert not capsys.readouterr().err


def test_paper_style_sets_width_letters_and_fonts(tmp_path):
    with skinwave.paper(3.5, 2.5):
        assert mpl.rcParams["font.size"] == 8
        figure = wave().plot().figure
        for ending in ("pdf", "svg"):
            figure.savefig(tmp_path / f"w.{ending}")
    assert mpl.rcParams["font.size"] != 8
    pdf = (tmp_path / "w.pdf").read_bytes()
    assert b"/FontFile2" in pdf  # TrueType
    assert b"/Type3" not in pdf
    assert b"MediaBox [ 0 0 252 180 ]" in pdf  # points
    assert "<text" in (tmp_path / "w.svg").read_text()
    assert sizes(figure) == {8.0}
    assert illegible(figure) == []
    assert style("talk", 7.0).size(6.0, 3.0) == (7.0, 3.5)
    with pytest.raises(ValueError, match="width"):
        style("print", 90.0)


def test_lazy_names_of_the_package_exist():
    source = (ROOT / "skinwave/__init__.py").read_text()
    typed = re.findall(r"    from (skinwave\S+) import (.+)", source)
    homes = {name: module for module, names in typed for name in names.split(", ")}
    assert homes == {name: f"skinwave.{home}" for name, home in skinwave._HOMES.items()}
    assert set(skinwave.__all__) == set(homes)
    assert all(getattr(skinwave, name).__doc__ for name in homes if name != "BODIES")
