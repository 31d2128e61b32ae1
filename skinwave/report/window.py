"""Figures in windows of the desktop, where there is one."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MISSING = (
    "no window can be opened here: there is no display, or no toolkit that matplotlib draws with "
    "(on Debian, apt install python3-tk; or pip install pyqt6)"
)


def open_windows(figures: Mapping[str, "Figure"]) -> None:
    """Open a window for each figure, by its title, and wait until all are closed."""
    import matplotlib.pyplot as plt

    for title, figure in figures.items():
        size = figure.get_size_inches()
        canvas = plt.figure(title, figsize=size).canvas
        figure.set_label(title)
        canvas.figure = figure  # drawn before, without a window, and now in this one
        figure.set_canvas(canvas)
    plt.show()


def has_windows() -> bool:
    """Whether matplotlib draws into windows: it finds that out when it is first asked."""
    import matplotlib.pyplot as plt
    from matplotlib.backends import BackendFilter, backend_registry

    windowed = backend_registry.list_builtin(BackendFilter.INTERACTIVE)
    return plt.get_backend().lower() in {name.lower() for name in windowed}
