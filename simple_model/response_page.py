"""A response in a line, and as a small page: its last waveforms, its spectrum, and its size."""

from typing import TYPE_CHECKING

import numpy as np

from simple_model import drawing
from simple_model.numbers import counted, significant, stated_error

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from simple_model.response import Response

SHOWN = 0.030  # s of waveforms, at their end
SETTLE = 0.25  # of a response, before which its RMS is not taken
MOST_ROWS = 12  # probes in the table


def line(response: "Response") -> str:
    """Model, quantity, size, expected error and number of warnings."""
    record, times = response.record, response.times
    largest = record.per_unit * float(np.abs(response.values).max(initial=0.0))
    said = [
        f"{record.words} ({counted(len(times), 'time')}, "
        f"{counted(len(response.probes), 'probe')}) from {1e3 * times[0]:g} to "
        f"{1e3 * times[-1]:.5g} ms, at most {significant(largest)} {record.shown}",
        f"expected error {stated_error(response.expected_error)}",
        counted(len(response.effort.warnings), "warning"),
    ]
    return f"<Response of {response.model}: {'; '.join(said)}>"


def html(response: "Response") -> str:
    """The page."""

    def draw(figure: "Figure") -> None:
        left, right = figure.subplots(1, 2)
        end = 1e3 * response.times[-1]
        response.plot(ax=left).set_xlim(max(1e3 * response.times[0], end - 1e3 * SHOWN), end)
        response.spectrum().plot(ax=right)
        if legend := right.get_legend():  # the same as that on the left
            legend.remove()

    image = drawing.picture(draw, 8, 2.6) if len(response.times) > 1 else b""
    title = f"{response.model}: {response.record.words}"
    return drawing.page(title, image, _tables(response), response.effort.warnings)


def _tables(response: "Response") -> list[str]:
    """Facts of a response, and its size at every probe, as tables of HTML."""
    effort, times, unit = response.effort, response.times, response.record.shown
    facts = [
        ["times", f"{len(times):,} from {1e3 * times[0]:g} to {1e3 * times[-1]:.5g} ms"],
        ["expected error", stated_error(response.expected_error)],
        ["degrees of freedom", f"{effort.dofs:,}" if effort.dofs else "none"],
        ["cost", f"{sum(effort.seconds.values()):.2g} s"],
    ]
    values = response.record.per_unit * response.values
    centred = values[int(SETTLE * len(values)) :]
    largest, rms = np.abs(values).max(axis=0), centred.std(axis=0)
    rows = [
        [drawing.place_name(place), f"{peak:.4g}", f"{level:.4g}"]
        for place, peak, level in zip(response.probes, largest, rms, strict=True)
    ]
    header = ["probe, mm", f"largest, {unit}", f"RMS about the mean, {unit}"]
    left = [[f"{len(rows) - MOST_ROWS:,} further probes"]] if len(rows) > MOST_ROWS else []
    listed = drawing.table([*rows[:MOST_ROWS], *left], header)
    return [drawing.table(facts), listed]
