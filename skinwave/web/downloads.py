"""Files that a page saves: the scene, waveforms as tables and sound, a figure, the report."""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from simple_model.choices import choose
from simple_model.response import step
from skinwave.exports import sampled, waveform_table
from skinwave.patterns import Options
from skinwave.patterns.conversion import write_pattern
from skinwave.pictures.styles import style
from skinwave.processes import apart
from skinwave.scene import BODIES, Scene, body_name, with_body
from skinwave.scene_file import dumps
from skinwave.web.asked import numbers
from skinwave.web.model import Answer
from skinwave.web.saved_figure import figure_of, seen, view_of

PATTERNS = (".adaptics", ".py", ".csv")
WIDTH = 7.0  # inch of a figure: two columns
FORMATS = ("svg", "png", "pdf")  # matplotlib knows others, some of which start a program


def offered(session: Any) -> dict[str, Callable[..., Any]]:
    """Functions that make the files of a session, by their names as triggers of the page.

    Waves are those of a body if its response is there; a file of several has the kernel's, too.
    """

    one_at_a_time = asyncio.Lock()

    def there() -> tuple[Answer, ...]:
        if not session.answers:
            raise ValueError("there is no response to save; correct the controls first")
        return tuple(session.answers)

    async def report() -> bytes:
        async with one_at_a_time:
            return await elsewhere(report_of, session.scene, there())

    async def figure(kind: str, width: float = WIDTH, view: str = "") -> bytes:
        choose("format of a figure", str(kind), FORMATS)
        (width,) = numbers(width)
        style("print", width)  # refuses what is no width of a page
        there()
        async with one_at_a_time:
            return await elsewhere(figure_of, seen(session, view_of(str(view))), kind, width)

    return {
        "scene_toml": lambda: dumps(session.scene).encode(),
        "waveform_csv": lambda: csv_of(there()),
        "waveform_wav": lambda: wav_of(there()[-1]),
        "pattern": lambda suffix: pattern_of(session.scene, suffix),
        "figure": figure,
        "report": report,
    }


def pattern_of(scene: Scene, suffix: str) -> bytes:
    """The Tacton for a device or its software, as `skinwave convert` writes it; raises a
    ValueError if the format cannot express it.
    """
    return write_pattern(scene, choose("format of a pattern", str(suffix), PATTERNS), Options())[0]


async def elsewhere(make: Callable[..., bytes], *given: Any) -> bytes:
    """Result of a function in a process of its own: the page stays live, and all the memory that
    drawing takes is freed with it.

    Raises
    ------
    RuntimeError
        If the process ends without it.
    """
    try:
        return await asyncio.to_thread(apart, make, *given)
    except Exception as error:
        raise RuntimeError(f"the process of {make.__name__} has ended without it") from error


def csv_of(answers: Sequence[Answer]) -> bytes:
    """Time in s and a column for each response, with its unit and place in the header."""
    x, y = 1e3 * answers[0].response.probes[0]
    header = ["time, s"] + [
        f"{a.response.quantity} at ({x:g}, {y:g}) mm, {a.response.unit} ({a.response.model})"
        for a in answers
    ]
    columns = [answers[0].response.times, *(a.response.values[:, 0] for a in answers)]
    return waveform_table(header, columns)


def wav_of(answer: Answer) -> bytes:
    """The waveform about its mean (16 bit, mono) at its own rate, as loud as the format holds."""
    from scipy.io import wavfile

    buffer = BytesIO()
    samples, _ = sampled(answer.response, 0)
    wavfile.write(buffer, round(1 / step(answer.response.times)), samples)
    return buffer.getvalue()


def report_of(scene: Scene, answers: Sequence[Answer]) -> bytes:
    """The report of `skinwave report` as one page, of the responses there are; no model is run."""
    from skinwave.effort import silent, versions
    from skinwave.files import fill
    from skinwave.reports.scene_report import write_report
    from skinwave.run import Run

    with TemporaryDirectory() as folder:
        results, out = Path(folder, "results"), Path(folder, "report")
        out.mkdir()
        for answer in answers:
            response, name = answer.response, _body_of(scene, answer)
            response = replace(response, effort=replace(response.effort, versions=versions()))
            own = scene if name != "none" else with_body(scene, BODIES["none"])
            (results / name).mkdir(parents=True)
            fill(results / name, Run(tacton=scene.name, body=name, scene=own, response=response))
        (results / "scene.toml").write_text(dumps(scene), encoding="utf-8")
        write_report(results, out, style("report"), silent)
        return (out / "index.html").read_bytes()


def _body_of(scene: Scene, answer: Answer) -> str:
    """The name of the body whose response this is."""
    if not answer.response.record.of_body:
        return "none"
    return body_name(scene.body)
