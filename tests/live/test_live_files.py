"""Files of the live page, in a browser: tables, sound and measurements."""

from io import BytesIO

import numpy as np
import pytest
from in_browser import needs_browser
from scipy.io import wavfile

from skinwave.measure.reading import read

pytestmark = needs_browser

ANSWER = """(own) => { const load = loadOf(own), x = own.x / 1e3, y = own.y / 1e3;
  const motion = respond(load), at = motion.at(x, y);
  return { values: own, load, x, y, body: { is_skin: true }, kernel: motion, kernelAt: at,
    waves: motion, wavesAt: at }; }"""
REFUSED = (
    "time [s],signal [V]\n0,1\n1,2\n2,3", "0,1\n1,2\n2,3", "time [s],u [m]\n0,1\n1,x\n2,3",
    "time [s],u [m]\n0,1\n1,2\n5,3\n6,2", "f [Hz],re v [m/s],im v [m/s]\n1,1,1\n2,2,1\n3,1,1",
)  # fmt: skip


def test_tables_and_sound(page, starts, tmp_path):
    table, lines, sound = page.evaluate(
        f"""(own) => {{ const answer = ({ANSWER})(own);
          return [waveformCsv(answer), linesCsv(answer), [...waveformWav(answer)]]; }}""",
        starts | {"duration": 0.2},
    )
    (tmp_path / "waveform.csv").write_text(table)
    measured = read(tmp_path / "waveform.csv")
    assert measured.quantity == "displacement"
    np.testing.assert_allclose(measured.places, [[0.01, 0]])
    rate, samples = wavfile.read(BytesIO(bytes(sound)))
    values = measured.values[0, :, 0] - measured.values.mean()
    assert rate == 10_000
    np.testing.assert_allclose(samples, 32767 * values / np.abs(values).max(), atol=1)
    header, *rows = lines.splitlines()
    assert header.startswith('line,"frequency, Hz","displacement, µm"')
    assert {"f_AM", "f_d", "f_d-f_AM"} <= {row.split(",")[0] for row in rows}


@pytest.mark.parametrize(
    ("header", "mark", "quantity"),
    [
        ("t [s],displacement(0,0) [m],displacement(10,-5) [m]", ",", "displacement"),
        ("Time (ms);Velocity (mm/s);Velocity 2 (mm/s)", ";", "velocity"),
        ("# from a vibrometer\ntime [s]\ta [m/s²]\tb [m/s²]", "\t", "acceleration"),
    ],
)
def test_reading_of_measurements(page, tmp_path, header, mark, quantity):
    t = np.arange(40) * 1e-3
    rows = (mark.join(f"{x:.9f}" for x in (a, np.sin(a), np.cos(a))) for a in t)
    text = "\n".join([header, *((row.replace(".", ",") if mark == ";" else row) for row in rows)])
    file = tmp_path / "measured.csv"
    file.write_text(text, encoding="utf-8")
    found = page.evaluate("(text) => readMeasurement(text, 'a.csv')", text)
    wanted = read(file)
    assert found["quantity"] == wanted.quantity == quantity
    np.testing.assert_allclose(found["values"], wanted.values[0].T, rtol=1e-12)
    np.testing.assert_allclose(found["times"], wanted.times - wanted.times[0], atol=1e-12)
    if "(0,0)" in header:
        np.testing.assert_allclose(found["places"], wanted.places)


def test_other_files_are_refused(page):
    read_all = "(texts) => texts.map((text) => attempt(() => readMeasurement(text, 'a.csv')))"
    for found in page.evaluate(read_all, REFUSED):
        assert "skinwave web" in found["refused"]
