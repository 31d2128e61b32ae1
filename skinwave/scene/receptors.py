"""Depths of receptors by name."""

from simple_model.choices import choose
from skinwave.system.plain_text import number_in

# Typical depths in m in the glabrous skin of a hand: Merkel cells at the base of the epidermis,
# Meissner corpuscles in the papillae next to them, Pacinian corpuscles in the deep dermis and
# below. They differ by half between places and people.
RECEPTORS = {"surface": 0.0, "meissner": 0.7e-3, "merkel": 0.75e-3, "pacini": 2e-3}


def depth_of(word: str) -> float:
    """Return the depth in m of a word on the command line: a number in mm, or a receptor."""
    number = number_in(word)
    return RECEPTORS[choose("--depth", word, RECEPTORS)] if number is None else number / 1e3
