"""Some columns of a result folder alone, as for a figure of a paper."""

from collections.abc import Sequence
from dataclasses import replace

from simple_model.choices import choose
from skinwave.studies.album import Album


def only(album: Album, columns: Sequence[str]) -> Album:
    """An album with these columns alone, such as "point-kernel" and "skin-slab"; all of them if
    none is named.

    Raises
    ------
    ValueError
        If it has no such column.
    """
    known = list(dict.fromkeys(run.column for run in album.runs))
    for name in columns:
        choose("column", name, known)
    wanted = columns or known
    return replace(
        album,
        runs=[run for run in album.runs if run.column in wanted],
        views={name: view for name, view in album.views.items() if name in wanted},
        maps={name: found for name, found in album.maps.items() if name in wanted},
    )
