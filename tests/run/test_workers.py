"""What happens when a worker dies or the parent is killed."""

import os
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from rivid.config import Config
from rivid.results.read import load_results
from rivid.run.run import Options, run
from tests.daily import write_days

DEADLY = """
import os, sys
from pathlib import Path
import rivid.run.batch as batch
read = batch.read_window
def deadly(root, sources, *rest, **more):
    if str(sources[-1].date) == "2008-03-13":
        os._exit(137)
    return read(root, sources, *rest, **more)
batch.read_window = deadly
"""


def test_the_day_that_kills_its_worker_is_alone_and_failed(tmp_path, monkeypatch):
    # a worker imports the module DEADLY by way of PYTHONSTARTUP's cousin: a sitecustomize on its path
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "sitecustomize.py").write_text(DEADLY)
    write_days(tmp_path / "data", 9)
    words = [
        sys.executable,
        "-m",
        "rivid",
        "run",
        str(tmp_path / "data"),
        "--out",
        str(tmp_path / "out"),
        "--no-figures",
    ]
    path = os.pathsep.join([str(tmp_path / "site"), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [*words, "--workers", "2"], env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True
    )
    assert done.returncode == 3, done.stderr
    (jmap,) = load_results(tmp_path / "out").estimators
    assert [s == "failed" for s in jmap.status] == [str(d) == "2008-03-13" for d in jmap.dates]
    assert "worker process died" in jmap.messages[3]


def test_progress_counts_every_day(tmp_path):
    write_days(tmp_path / "data", 5)
    seen = []

    class Bar:
        def __enter__(self):
            return seen.append

        def __exit__(self, *_):
            return None

    summary = run(
        tmp_path / "data", tmp_path / "out", Config(), Options(workers=2, figures=False), lambda n: Bar()
    )
    assert summary.computed == sum(seen) == 5


def test_one_worker_draws_in_the_process_itself(tmp_path):
    write_days(tmp_path / "data", 3)
    words = [sys.executable, "-m", "rivid", "run", str(tmp_path / "data"), "--workers", "1", "--out"]
    child = subprocess.Popen([*words, str(tmp_path / "out")], stdout=subprocess.DEVNULL)
    seen = 0
    while child.poll() is None:
        with suppress(psutil.Error):  # it may be gone by now
            seen = max(seen, len(psutil.Process(child.pid).children()))
        time.sleep(0.01)
    assert child.returncode == 0 and seen == 0
    assert (tmp_path / "out" / "report.html").exists()


def test_pages_are_the_same_whoever_draws(tmp_path):
    write_days(tmp_path / "data", 4)
    config = Config()
    for number in (1, 2):
        run(tmp_path / "data", tmp_path / str(number), config, Options(workers=number))
    figures = sorted(p.name for p in (tmp_path / "1" / "figures").iterdir())
    assert len(figures) == 5
    for name in figures:
        assert (tmp_path / "1" / "figures" / name).read_bytes() == (
            tmp_path / "2" / "figures" / name
        ).read_bytes()


@pytest.mark.parametrize("engine", ["processes", "dask"])
def test_what_lies_in_the_current_directory_is_never_imported(engine, tmp_path):
    write_days(tmp_path / "data", 4)
    (tmp_path / "here" / "rivid").mkdir(parents=True)  # a clone, where one stands
    for name in ("numpy", "pyarrow", "rivid/batch", "sitecustomize"):
        (tmp_path / "here" / f"{name}.py").write_text(f"open({str(tmp_path / 'taken')!r}, 'w')\n")
    rivid = Path(sys.executable).with_name("rivid")
    words = [rivid, "run", tmp_path / "data", "--out", tmp_path / "out", "--quiet"]
    done = subprocess.run(
        [*words, "--workers", "2", "--engine", engine],
        cwd=tmp_path / "here", capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert not (tmp_path / "taken").exists()
    assert (tmp_path / "out" / "report.html").exists()
