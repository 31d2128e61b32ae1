"""The interactive tool: change a Tacton's parameters and see at once how a point of the skin moves.

`controls` are the parameters, `scenes` makes a scene of them, `model` arrays, `plots`, `drawings`
and `moving` the contents of plots, maps and the moving body, all without a browser. `waves` and
`worker` compute the response of a body, in a process of its own; `session`, `shown` and `layout`
are the page, with curves and body drawn in `static`; `front` gives each page a process of its own
(`processes`), when it is its turn (`turns`); `page` is its text, `access` says who may open one,
and `asked` what it may send.
"""

EXTRA = ("trame", "trame_vuetify")


def check_extra() -> None:
    """Refuse to start without what a page is made of.

    Raises
    ------
    ValueError
        If one of `EXTRA` is not installed.
    """
    from importlib.util import find_spec

    if missing := [name for name in EXTRA if find_spec(name) is None]:
        raise ValueError(
            f"the interactive tool needs {' and '.join(missing)}, which "
            f"{'is' if len(missing) == 1 else 'are'} not installed; "
            "pip install 'skinwave[web]'"
        )
