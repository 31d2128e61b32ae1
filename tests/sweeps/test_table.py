"""The table of a sweep: its rows and files, what is kept, what interrupts it, its figures."""

import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import read_results

from skinwave.commands.cli import main
from skinwave.report.styles import style
from skinwave.scene.variation import combinations, parse
from skinwave.sweeps import dataset, engine, table_figures
from skinwave.sweeps import sweep as sweeping

THREADS = ["--scheduler", "threads", "--quiet"]
KERNEL = ["--model", "point-kernel"]
SPEED, SIZE = "tacton.speed_m_per_s", "tacton.size_mm"
OUT = Path("short-sweep")


def swept(*arguments):
    code, rows = main(["sweep", "short.toml", *map(str, arguments), *THREADS]), dataset.read(OUT)
    assert code == any(row["status"] == "failed" for row in rows)
    return rows


def test_rows_have_the_order_of_the_design_and_are_not_repeated(scene, monkeypatch):
    vary = ["--vary", f"{SPEED}=8,4,70,6", f"{SIZE}=9,8", *KERNEL]
    rows = swept(*vary)
    design = [(v, d) for v in (8, 4, 70, 6) for d in (9, 8)]
    assert [(row[SPEED], row[SIZE]) for row in rows] == design
    assert [row["index"] for row in rows] == list(range(8))
    for part in list((OUT / "rows").glob("*.parquet"))[::2]:
        part.unlink()
    assert [row["key"] for row in swept(*vary)] == [row["key"] for row in rows]  # resumed
    with monkeypatch.context() as patch:
        patch.setattr(sweeping, "_row", lambda *given: 1 / 0)  # any run would fail
        swept(*vary)
    more = swept("--vary", f"{SPEED}=5,4", f"{SIZE}=9", "--csv", *KERNEL)
    assert [(row[SPEED], row[SIZE]) for row in more] == [*design, (5, 9)]
    lines = read_results.rows(OUT / "rows.csv")
    assert [line["index"] for line in lines] == list(map(str, range(9)))
    assert float(lines[0]["kernel_peak_pa[1]"]) == pytest.approx(rows[0]["kernel_peak_pa"][1])


def test_wrong_keys_and_values_are_refused_in_one_sentence(scene, refused):
    for words in (
        "tacton.speed_m_s=1,2", "zzzz=1", "tacton.size_mm=", "tacton.shape=circle,sqare",
        "body=moon", "tacton.size_mm=1 tacton.size_mm=2", "tacton.size_mm=1:2:2.5",
        "tacton.size_mm=1:2", "tacton.size_mm=70,80",
        "tacton.size_mm=1:2:1000 body.thickness_mm=1:2:1000", "tacton.size_mm=1:2 --design lhs",
        "tacton.size_mm=1,2 --design latin", "tacton.size_mm=1,2 --workers 0",
        "tacton.size_mm=1,2 --scheduler cloud", "tacton.size_mm=1,2 --out .",
    ):  # fmt: skip
        refused("sweep", scene, "--vary", *words.split())
    refused("sweep", scene)
    refused("sweep", ".", "--plot")
    assert not OUT.exists()


def test_missing_packages_and_schedulers_are_refused(scene, refused, monkeypatch):
    vary = ["--vary", "tacton.size_mm=1,2", "--scheduler"]
    with monkeypatch.context() as patch:
        patch.setattr(engine, "find_spec", lambda name: None)
        assert "skinwave[sweep]" in refused("sweep", scene, *vary, "threads")
        assert "skinwave[cluster]" in refused("sweep", scene, *vary, "tcp://a:1")
    monkeypatch.setattr(engine, "_client", partial(engine._client, timeout=0.5))
    nowhere = "tcp://127.0.0.1:9"
    assert nowhere in refused("sweep", scene, *vary, nowhere)
    assert sorted(path.name for path in scene.parent.iterdir()) == ["short.toml"]


def test_changed_files_are_kept_and_other_tables_refused(scene, refused):
    vary = ["--vary", f"{SPEED}=4,6", *KERNEL]
    swept(*vary, "--csv", "--plot", "kernel_peak_pa")
    swept(*vary, "--csv", "--plot", "kernel_peak_pa")
    (figure,) = (OUT / "figures").iterdir()
    for path, words in ((OUT / "rows.csv", ["--csv"]), (figure, ["--plot", "kernel_peak_pa"])):
        path.write_bytes(b"mine")
        assert path.name in refused("sweep", OUT, *words)
        assert path.read_bytes() == b"mine"
        path.unlink()
    pq.write_table(pa.table({"price": [1.0]}), OUT / "rows/part-mine.parquet")
    refused("sweep", "short.toml", *vary, *THREADS)
    (OUT / "rows/part-mine.parquet").write_text("no Parquet")
    refused("sweep", OUT, "--csv")


def test_only_one_sweep_writes_into_a_folder(scene, refused):
    folder = dataset.open_folder(OUT)
    arguments = ["sweep", "short.toml", "--vary", "body.thickness_mm=10,15", *THREADS]
    with dataset.lock_rows(folder):
        assert "short-sweep" in refused(*arguments)
    there = "import os, sys; from pathlib import Path; from skinwave.sweeps import dataset; "
    held = "held = dataset.lock_rows(Path(sys.argv[1])); held.__enter__(); os._exit(0)"
    subprocess.run([sys.executable, "-c", there + held, str(folder)], check=True)
    with dataset.lock_rows(folder):
        assert not dataset.names(folder)


def test_an_interrupted_sweep_resumes_without_lost_or_repeated_rows(scene, monkeypatch):
    command = ["--vary", f"{SPEED}=3:8:7", *KERNEL]
    inner, written = dataset.append, []

    def interrupted(*given):
        if len(written) == 3:
            raise KeyboardInterrupt
        written.append(given)
        inner(*given)

    with monkeypatch.context() as patch:
        patch.setattr(dataset, "append", interrupted)
        assert main(["sweep", "short.toml", *command, *THREADS]) == 1
    assert len(dataset.read(OUT)) == 3
    rows = swept(*command)
    assert len({row[SPEED] for row in rows}) == len(rows) == 7
    parts = (OUT / "rows").glob("part-*.parquet")
    assert sum(pq.read_metadata(part).num_rows for part in parts) == 7


@pytest.fixture
def address(monkeypatch):
    from distributed import LocalCluster

    path = os.pathsep.join([str(Path(__file__).parents[2]), *sys.path])
    monkeypatch.setenv("PYTHONPATH", path)  # workers find this checkout, whatever is installed
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    no_cache = {"SKINWAVE_CACHE": ""}  # workers that share no folder with this process
    with LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, env=no_cache
    ) as cluster:
        yield cluster.scheduler_address


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of Dask's own event loop
def test_processes_and_a_cluster_give_the_same_table(scene, address):
    small = ["body.size_x_mm=40", "body.size_y_mm=40", "body.sides=clamped"]
    sweep = ["sweep", "short.toml", "--vary", f"{SPEED}=4,6", "tacton.am_frequency_hz=0,100",
             *small, "--model", "fem", "--element-size", "10", "--quiet"]  # fmt: skip
    assert main([*sweep, "--out", "here"]) == 0
    assert main([*sweep, "--out", "there", "--scheduler", address]) == 0
    here, there = dataset.read(Path("here")), dataset.read(Path("there"))
    assert [row["key"] for row in here] == [row["key"] for row in there]
    for name in ("peak_um", "rms_um", "expected_error"):
        first, second = (np.array([row[name] for row in rows], float) for rows in (here, there))
        np.testing.assert_allclose(first, second, rtol=1e-10, atol=1e-12)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_with_another_version_is_refused_and_one_that_ends_is_named(
    tmp_path, monkeypatch
):
    from distributed import LocalCluster

    (tmp_path / "scipy-9.9.9.dist-info").mkdir()
    (tmp_path / "scipy-9.9.9.dist-info/METADATA").write_text(
        "Metadata-Version: 2.1\nName: scipy\nVersion: 9.9.9\n"
    )
    other = tmp_path / "other.py"
    other.write_text(f"import sys\nsys.path.insert(0, {str(tmp_path)!r})\n")
    own = os.pathsep.join([str(Path(__file__).parents[2]), *sys.path])
    monkeypatch.setenv("PYTHONPATH", own)
    small = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None}
    with LocalCluster(**small, preload=[str(other)]) as cluster:
        address = cluster.scheduler_address
        with pytest.raises(ValueError, match=r"scipy is 9\.9\.9 on the Dask worker tcp"):
            engine.worker_count(address)
        with pytest.raises(ValueError, match=r"install the same version"):
            engine.run_all(abs, [-1], address, 1, {}.update)
    with LocalCluster(**small) as cluster:
        address = cluster.scheduler_address
        assert engine.worker_count(address) == 1
        with pytest.raises(ValueError, match=f"{address} has ended"):
            engine.run_all(abs, [-1, -2, -3], address, 1, lambda found: cluster.close())


def test_figures_have_units_and_names_in_every_format(scene, capsys, refused):
    swept("--vary", f"{SPEED}=4,6", f"{SIZE}=8,10,70")
    for kind in ("png", "svg", "pdf"):
        drawn = ["sweep", "short-sweep", "--format", kind, "--quiet"]
        assert main([*drawn, "--plot", "f_AM_um[1]", "level_db"]) == 1  # two runs failed
        assert main([*drawn, "--plot", "spread_6db_mm", "--heat"]) == 1
        files = list((OUT / "figures").glob(f"*.{kind}"))
        assert len(files) == 3
        assert all(file.stat().st_size > 5000 for file in files)
    text = "".join(file.read_text() for file in (OUT / "figures").glob("*.svg"))
    assert "size of the path, mm" in text
    assert not any(b"/Type3" in file.read_bytes() for file in (OUT / "figures").glob("*.pdf"))
    capsys.readouterr()
    for words in (["peak"], ["sensation_line"], ["peak_um", "--vary", f"{SPEED}=1"]):
        refused("sweep", OUT, "--plot", *words)


def test_a_material_with_varied_factors_is_not_a_varied_key():
    rows = [{"body.material": f"{k}", "body.material.modulus_scale": k, SIZE: 8} for k in (1, 2)]
    assert table_figures.varied_keys(rows) == ["body.material.modulus_scale"]


def test_a_latin_hypercube_is_drawn_as_coloured_points():
    met = combinations([parse(f"{SPEED}=2:12"), parse(f"{SIZE}=5:20")], "lhs", 20)
    rows = [each | {"status": "done", "peak_um": sum(each.values())} for each in met]
    figure = table_figures.line_figure(rows, "peak_um", SPEED, SIZE, style("report"))
    ax, bar = figure.axes
    assert bar.get_ylabel() == "size of the path, mm"
    assert ax.get_legend() is None
    drawn = sorted((line.get_xdata()[0], line.get_ydata()[0]) for line in ax.lines)
    assert drawn == sorted((row[SPEED], row["peak_um"]) for row in rows)
    assert max(len(line.get_xdata()) for line in ax.lines) == 1  # nothing is joined
    with pytest.raises(ValueError, match="grid"):
        table_figures.heat_figure(rows, "peak_um", SPEED, SIZE, style("report"))


def test_many_curves_have_a_colour_bar_and_levels_the_threshold():
    rows = [{SPEED: float(v), SIZE: float(d), "status": "done", "level_db": float(v + d),
             "rayleigh_speed_m_per_s": 1.5} for v in range(3) for d in range(12)]  # fmt: skip
    figure = table_figures.line_figure(rows, "level_db", SPEED, SIZE, style("print"))
    curves = [line for line in figure.axes[0].lines if line.get_linestyle() == "-"]
    assert [len(line.get_xdata()) for line in curves] == 12 * [3]
    assert len(figure.axes) == 2
    legend = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert [words.split()[0] for words in legend] == ["threshold,", "Rayleigh"]
    assert figure.get_figwidth() == 3.5


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_without_workers_is_named(capsys):
    from distributed import LocalCluster

    with LocalCluster(n_workers=0, dashboard_address=None) as cluster:
        assert engine.worker_count(cluster.scheduler_address) == 1
        assert f"{cluster.scheduler_address} has no workers" in capsys.readouterr().err
