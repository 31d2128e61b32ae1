"""Numbers and tables as pages and files print them."""

import numpy as np
from markupsafe import Markup

from simple_model import Effort
from simple_model.numbers import decibel, interval, significant, with_error
from skinwave.report.column_labels import axis_label
from skinwave.system.document import Details, Picture, Report, Section
from skinwave.system.table import Column, Table
from skinwave.system.templates import typeset

TABLE = Table(
    [Column("f_hz", "frequency", "Hz"), "line"], [(127.384, "f_d"), (np.nan, "=1+1")], name="lines"
)


def test_a_number_has_three_significant_digits():
    found = map(significant, (0.0, 9.996, 999.6, -3.14159, 1.26e-5, np.nan))
    assert [*found] == ["0", "10.0", "1,000", "-3.14", "1.26e-05", "-"]


def test_levels_errors_and_ranges():
    assert decibel(-288.6) == "< -120"
    assert decibel(-0.01, signed=True) == "+0.0"
    assert decibel(np.inf) == "-"
    assert with_error(1.23456, 0.0234) == "1.235 ± 0.023"
    assert with_error(1.23456, np.nan) == "1.23"
    assert interval(5, 25.2) == "5.0\u201325"
    assert interval(-5, 25) == "-5.0 to 25"


def test_axis_label_has_a_unit_and_no_part_of_it_in_words():
    labels = {
        "body.material.viscosity_pa_s": "material.viscosity, Pa s", "mesh_seconds": "mesh, s",
        "seconds": "seconds, s", "2f_d_kernel_um": "$2f_{d}$ of the point kernel, µm",
    }  # fmt: skip
    assert {name: axis_label(name) for name in labels} == labels


def test_a_table_is_csv_json_and_html():
    assert TABLE.to_csv() == b"f_hz,line\r\n127.384,f_d\r\n,'=1+1\r\n"
    assert TABLE.records()[1] == {"f_hz": None, "line": "=1+1"}
    assert '<th class="number">frequency, Hz</th><th>line</th>' in TABLE.html()
    assert '<td class="number">127</td>' in TABLE.html()
    assert TABLE.only("line", most=1).rows == (("f_d",),)


def test_numbers_and_symbols_are_typeset_and_options_are_code():
    made = {
        "31 % at -20 dB": "31\u00a0% at \u221220\u00a0dB",
        "2f_d-f_AM, 3 f_AM": "2\u202ff<sub>d</sub>\u202f\u2212\u202ff<sub>AM</sub>, "
        "3\u202ff<sub>AM</sub>",
        "(10, -5) mm": "(10,\u00a0\u22125)\u00a0mm",
        "p = 1e-05": "p = 1\u00a0\u00d7\u00a010<sup>\u22125</sup>",
        "use --gain -20": "use <code>--gain -20</code>",
        "am140-stm20, doi 10.1/3-7": "am140-stm20, doi 10.1/3-7",
    }
    assert {text: str(typeset(text)) for text in made} == made
    assert typeset(Markup("-20 dB")) == "-20 dB"


def test_a_report_writes_its_page_pictures_and_tables(tmp_path):
    parts = [Section("A", [Details("B", [TABLE, Picture(b"p", "caption", "map")])]), "<text>"]
    Report("title", ["verdict"], parts).write(tmp_path)
    page = (tmp_path / "index.html").read_text()
    assert "failed" not in page
    assert page.index("<h1>title") < page.index(">verdict") < page.index(">A</h2>")
    assert "<p>&lt;text&gt;</p>" in page
    assert (tmp_path / "map.png").read_bytes() == b"p"
    assert (tmp_path / "lines.csv").read_bytes() == TABLE.to_csv()


def test_the_first_sentence_of_a_page_names_what_failed():
    failures = {"film": "no memory.", "map of palm": "no mesh"} | {
        f"run {k}": "bad" for k in range(9)
    }
    warned = [("", Effort(warnings=("coarse",)))]
    page = Report("title", ["verdict"], efforts=warned, failures=failures).html()
    said = (
        "11 parts of this result failed: film (no memory); map of palm (no mesh); run 0, run 1, "
        "run 2 and 6 more (bad)."
    )
    assert page.index(said) < page.index("coarse") < page.index(">verdict")
