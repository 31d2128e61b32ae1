"""Reads the files of results: arrays of an .npz file, rows of a .csv file."""

import csv
from pathlib import Path

import numpy as np


def arrays(path):
    with np.load(path) as archive:
        return dict(archive)


def rows(path):
    with Path(path).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))
