"""Test bombs in every command that reads: refused within seconds, without the memory that they declare."""

import gzip
import resource
import time
import zlib

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.daily import text_of, write_days
from tests.logs.helpers import DAY
from tests.run.test_run import command

MEMORY = 3 << 30
"""Limit of the address space [B]: the mappings of numpy and Arrow, and 1 GB."""


def gz(path):
    packer = zlib.compressobj(9, zlib.DEFLATED, 31)
    block = b"0" * (1 << 20)
    path.write_bytes(b"".join(packer.compress(block) for _ in range(105)) + packer.flush())


def gz_in_gz(path):
    gz(path)
    path.write_bytes(gzip.compress(path.read_bytes()))


def gz_of_rows(path):
    head, *rows = text_of(DAY).splitlines()
    path.write_bytes(gzip.compress("\n".join([head, *rows * 4000]).encode(), 1))


def parquet(path):
    n = 21_000_000
    codes = pa.DictionaryArray.from_arrays(pa.array(np.zeros(n, np.int8)), pa.array([300.0]))
    table = pa.table({"time": pa.array(np.zeros(n, np.int64), pa.timestamp("us", "UTC")), "u_Qi": codes})
    table = table.append_column("u_Qo", codes).append_column("h_L", codes)
    pq.write_table(table, path, compression="zstd")


def sparse(path):
    with path.open("wb") as file:
        file.truncate(50 << 30)


def one_line(path):
    path.write_bytes(b"time,u_Qi,u_Qo,h_L\n" + b"9" * (60 << 20))


def many_columns(path):
    path.write_text(",".join(f"c{k}" for k in range(200_000)) + "\n" + "," * 199_999 + "\n")


BOMBS = {
    "gzip of 105 MB": (gz, ".csv.gz"),
    "gzip in gzip": (gz_in_gz, ".csv.gz"),
    "gzip of 2.6 million rows": (gz_of_rows, ".csv.gz"),
    "Parquet of 21 million rows": (parquet, ".parquet"),
    "sparse file of 50 GB": (sparse, ".csv"),
    "line of 60 MB": (one_line, ".csv"),
    "header of 200,000 columns": (many_columns, ".csv"),
}


EXPORTS = ("gzip of 2.6 million rows",)
"""Too large for a day, but not for an export of many years."""


def limited():
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


@pytest.mark.long
@pytest.mark.parametrize("kind", BOMBS)
def test_bombs_are_refused_by_every_command_that_reads(tmp_path, tried, kind):
    make, suffix = BOMBS[kind]
    data = tmp_path / "data"
    write_days(data, 2)
    bomb = data / f"{DAY}{suffix}"
    (data / f"{DAY}.csv").unlink()
    make(bomb)
    config = tmp_path / "c.toml"
    config.write_text("")
    for words, codes in (
        (("run", data, "--out", tmp_path / "out", "--no-figures"), (3,)),
        (("check", data), (3,)),
        (("sniff", bomb), (0, 1, 2)),  # the first rows are sufficient
        (("ingest", bomb, "--out", tmp_path / "logs", "--config", config), (1, 2)),
    )[: 3 if kind in EXPORTS else 4]:
        began = time.monotonic()
        done = command(*words, preexec_fn=limited)
        assert time.monotonic() - began < 20
        assert done.returncode in codes, (words[0], done.returncode, done.stdout[-500:], done.stderr[-500:])
        assert "Traceback" not in done.stderr
        assert DAY.isoformat() in done.stdout + done.stderr
    assert not (tmp_path / "logs").exists()
    tried(f"{kind}: run, check, sniff, ingest, with 3 GB of address space", 3 if kind in EXPORTS else 4)
