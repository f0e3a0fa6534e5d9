"""Generate logs by the million: each day is a simulated day, scaled, shifted and disturbed at random.

All changes of a day are linear in its deviations, so it keeps its delay. No two files are alike.
"""

import datetime as dt
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Literal

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet as pq
from numpy.typing import NDArray

from rivid.simulation import Season

FIRST = dt.date(1995, 1, 1)
DAYS_A_FILE = 365
Format = Literal["csv", "parquet"]


def write_fleet(season: Season, data: Path, reaches: int, days: int, format: Format) -> None:
    """Write the logs of a fleet.

    Parameters
    ----------
    season : Season
        Simulated days to draw from.
    data : Path
        Folder in which a directory is created for each reach.
    reaches, days : int
        Number of reaches, and days of each.
    format : {"csv", "parquet"}
        A CSV file for each day, or Parquet files of 365 days.
    """
    arrays = (season.inflow, season.outflow, season.level)
    with ProcessPoolExecutor(2) as pool:
        tasks = [
            pool.submit(write_reach, arrays, season.sample_time, data / f"r{r:05d}", r, days, format)
            for r in range(reaches)
        ]
        for task in tasks:
            task.result()


def write_reach(
    arrays: tuple[NDArray[np.float64], ...],
    sample_time: float,
    folder: Path,
    seed: int,
    days: int,
    format: Format,
    first: dt.date = FIRST,
) -> None:
    """Write the logs of one reach; `arrays` are inflow, outflow [m3/s] and level [m], shape (days, N)."""
    folder.mkdir(parents=True, exist_ok=True)
    size = DAYS_A_FILE if format == "parquet" else 64
    for block, begin in enumerate(range(0, days, size)):
        n = min(size, days - begin)
        columns = disturbed(arrays, n, np.random.default_rng([seed, block, first.toordinal()]))
        date = first + dt.timedelta(days=begin)
        if format == "parquet":
            write_parquet(folder / f"{date}_{n}.parquet", date, columns, sample_time)
        else:
            for day in range(n):
                write_csv(folder, date + dt.timedelta(days=day), [c[day] for c in columns], sample_time)


def disturbed(
    arrays: tuple[NDArray[np.float64], ...], days: int, rng: np.random.Generator
) -> tuple[NDArray[np.float64], ...]:
    """Draw `days` of the season's days at random, scaled and shifted, with new noise on the level."""
    which = rng.integers(0, len(arrays[0]), days)
    scale = rng.uniform(0.7, 1.3, (days, 1))
    shift = rng.uniform(-20.0, 20.0, (days, 1))
    inflow, outflow, level = (a[which] for a in arrays)
    begin = level[:, :1]
    return (
        np.round(inflow[:, :1] + shift + scale * (inflow - inflow[:, :1]), 1),
        np.round(outflow[:, :1] + shift + scale * (outflow - outflow[:, :1]), 1),
        np.round(begin + scale * (level - begin) + rng.normal(0.0, 0.002, level.shape), 3),
    )


def write_parquet(
    path: Path, first: dt.date, columns: tuple[NDArray[np.float64], ...], sample_time: float
) -> None:
    """Write consecutive days as one Parquet file."""
    n, samples = columns[0].shape
    midnight = (first - dt.date(1970, 1, 1)).days * 86_400_000
    within = np.round(np.arange(samples) * sample_time * 1000).astype(np.int64)
    time = (midnight + 86_400_000 * np.arange(n)[:, None] + within).ravel()
    table = pa.table(
        {
            "time": pa.array(time, pa.timestamp("ms", "UTC")),
            **{name: column.ravel() for name, column in zip(("u_Qi", "u_Qo", "h_L"), columns, strict=True)},
        }
    )
    pq.write_table(
        table, path, compression="zstd", compression_level=1, use_dictionary=["u_Qi", "u_Qo", "h_L"]
    )


def write_csv(folder: Path, date: dt.date, columns: list[NDArray[np.float64]], sample_time: float) -> None:
    """Write a day as CSV."""
    seconds = np.round(np.arange(len(columns[0])) * sample_time * 1000).astype("timedelta64[ms]")
    time = pa.array((np.datetime64(date, "ms") + seconds), pa.timestamp("ms"))
    table = pa.table(
        {
            "time": pc.binary_join_element_wise(pc.cast(time, pa.string()), "Z", ""),
            **dict(zip(("u_Qi", "u_Qo", "h_L"), columns, strict=True)),
        }
    )
    options = pyarrow.csv.WriteOptions(quoting_style="none")
    pyarrow.csv.write_csv(table, folder / f"{date}.csv", options)
