"""Reads the files of results: arrays of an .npz file, rows of a .csv file."""

import csv
import re
from pathlib import Path

import numpy as np


def arrays(path):
    with np.load(path) as archive:
        return dict(archive)


def page(path):
    """Text of a page with plain spaces and minus signs."""
    text = Path(path).read_text("utf-8")
    return re.sub("[\u00a0\u202f]", " ", text).replace("\u2212", "-")


def rows(path):
    with Path(path).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
