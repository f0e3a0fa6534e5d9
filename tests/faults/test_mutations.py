"""Test that a log of arbitrary bytes gives a data set or a reason, never another exception."""

import gzip
import io

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rivid.errors import RividError
from rivid.logs.days import find_days, read_window
from rivid.logs.sniff.propose import sniff
from tests import examples
from tests.logs.helpers import DAY, config, rows, text

REACH = {"sample_time": 900}
CSV = text(rows(n=96, step=900)).encode()
_CELLS = [[cell.replace(".", ",") for cell in row] for row in rows(n=96, step=900, zone="")]
FRENCH = text(_CELLS, head="time;u_Qi;u_Qo;h_L", separator=";").encode()


def _parquet():
    sink = io.BytesIO()
    times = np.arange(96) * 900_000_000 + 1_205_103_600_000_000
    table = {"time": pa.array(times, pa.timestamp("us", "+01:00"))}
    table |= {name: np.arange(96.0) for name in ("u_Qi", "u_Qo", "h_L")}
    pq.write_table(pa.table(table), sink)
    return sink.getvalue()


SEEDS = {".csv": CSV, ".parquet": _parquet(), ".csv.gz": gzip.compress(CSV, mtime=0)}
WORDS = st.sampled_from(
    [b"", b"\n", b"\r", b",", b";", b'"', b"\0", b"nan", b"-inf", b"1e999", b"-999", b"\xff", b"\xef\xbb\xbf",
     b"24:00", b"9999-12-31T23:59:59.999999-14:00", b"0001-01-01", b"+99:99", b"9" * 400, b"time",
     b"2008-03-10", b"#", b"u_Qi"]
)  # fmt: skip


@st.composite
def mutated(draw, seed):
    """Draw a log with a few bytes changed, removed, inserted or repeated."""
    content = bytearray(seed)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(len(content) - 1, 0)))
        match draw(st.integers(0, 4)):
            case 0:
                content[at : at + 1] = bytes([draw(st.integers(0, 255))])
            case 1:
                del content[at : at + draw(st.integers(1, 60))]
            case 2:
                content[at:at] = draw(WORDS)
            case 3:
                content[at:at] = content[at : at + draw(st.integers(1, 200))]
            case 4:
                del content[at:]
    return bytes(content)


LOOP = settings(
    max_examples=examples(60), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def outcome(folder, settings_):
    """Return the numbers of days that are read and refused; fail on anything but a reason."""
    done = [0, 0]
    try:
        for source in find_days(folder, settings_).days:
            try:
                data = read_window(folder, [source], settings_)
            except RividError as error:
                assert str(error)
                done[1] += 1
            else:
                assert np.isfinite([data.inflow, data.outflow, data.output]).all()
                done[0] += 1
    except RividError as error:
        assert str(error)
    return done


UNUSUAL = {"separator": ";", "decimal": ",", "thousands": ".", "time_zone": "Europe/Paris",
           "sentinels": [-999], "ambiguous": "order"}  # fmt: skip
CASES = [(f"{name}{suffix}", seed, {}) for suffix, seed in SEEDS.items() for name in (f"{DAY}", "march")]


@pytest.mark.parametrize(("name", "seed", "declared"), [*CASES, ("march.csv", FRENCH, UNUSUAL)])
def test_any_bytes(tmp_path, name, seed, declared):
    path, settings_ = tmp_path / name, config(REACH, **declared)
    path.write_bytes(seed)
    assert outcome(tmp_path, settings_) == [1, 0]  # the seed itself is valid

    @LOOP
    @given(mutated(seed))
    def attack(content):
        path.write_bytes(content)
        outcome(tmp_path, settings_)

    attack()


def test_any_bytes_sniffed(tmp_path):
    path = tmp_path / "export.csv"

    @LOOP
    @given(mutated(FRENCH))
    def attack(content):
        path.write_bytes(content)
        try:
            assert sniff(path).toml.count("[input]") >= 1
        except RividError as error:
            assert "export.csv" in str(error)

    attack()
