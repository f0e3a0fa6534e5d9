"""Measure the minimum of a run: import the same libraries, read the same files, save one figure.

Usage: python -m benchmarks.floor DATA_DIR FIGURE.png
"""

import sys
from pathlib import Path

import click  # noqa: F401
import jinja2  # noqa: F401
import numpy as np
import pyarrow.csv
import pyarrow.parquet  # noqa: F401
import pydantic  # noqa: F401
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

options = pyarrow.csv.ReadOptions(use_threads=False)  # threads are slower for small files
levels = []
for path in sorted(Path(sys.argv[1]).glob("*.csv")):
    table = pyarrow.csv.read_csv(path, options)
    levels.append(table["h_L"].to_numpy()[:649])
figure = Figure(figsize=(8, 4))
FigureCanvasAgg(figure)
figure.subplots().imshow(np.stack(levels).T, aspect="auto", cmap="gray_r")
figure.savefig(sys.argv[2], dpi=120)
