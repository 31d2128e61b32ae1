"""Worked examples of the page: what an address sets, and what is to be seen then."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Example:
    """An example: a `title`, what it shows in a `sentence`, and the `query` of its address; seen
    as a moving body if `solid`, as maps if not, its `layers` unfolded or not.
    """

    title: str
    sentence: str
    query: str
    solid: bool = False
    layers: bool = False


EXAMPLES = {
    "beyond": Example(
        title="Motion beyond the path",
        sentence="AM at 200 Hz on a point: the kernel ends at the focus, waves carry it on.",
        query="shape=point&size=0&am=200&x=15",
    ),
    "wake": Example(
        title="Faster than its waves",
        sentence="A focus that outruns the surface waves of soft skin drags a wake behind it.",
        query="am=0&size=40&speed=9&x=20",
        solid=True,
    ),
    "layers": Example(
        title="A stiff top layer",
        sentence="0.3 mm of stiff epidermis over soft layers: see the layers' sliders.",
        query="body=palm-layers&am=140&size=20&speed=6",
        layers=True,
    ),
}
