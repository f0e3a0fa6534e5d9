"""Test workers: death of one, progress, figures and imports."""

import os
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import pytest

from rivid.config import Config
from rivid.results.read import load_results
from rivid.run.run import Options, run
from rivid.run.workers import Engine, Processes
from tests.daily import write_days

DEADLY = """
import os, sys
from pathlib import Path
import rivid.run.run as batch
read = batch.logs.read_window
def deadly(root, sources, *rest, **more):
    if str(sources[-1].date) == "2008-03-13":
        os._exit(137)
    return read(root, sources, *rest, **more)
batch.logs.read_window = deadly
"""


def test_the_day_that_kills_its_worker_is_alone_and_failed(tmp_path, monkeypatch):
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "sitecustomize.py").write_text(DEADLY)  # imported by the workers
    write_days(tmp_path / "data", 9)
    words = [
        sys.executable,
        "-m",
        "rivid",
        "run",
        tmp_path / "data",
        "--out",
        tmp_path / "out",
        "--no-figures",
    ]
    path = os.pathsep.join([str(tmp_path / "site"), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [*words, "--workers", "2"], env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True
    )
    assert done.returncode == 3, done.stderr
    jmap, _ = load_results(tmp_path / "out").estimators
    assert [s == "failed" for s in jmap.status] == [str(d) == "2008-03-13" for d in jmap.dates]
    assert "worker process died" in jmap.messages[3]


def test_progress_counts_every_day(tmp_path):
    write_days(tmp_path / "data", 5)
    seen = []
    options = Options(workers=2, figures=False)
    summary = run(tmp_path / "data", tmp_path / "out", Config(), options, lambda n: nullcontext(seen.append))
    assert summary.computed == sum(seen) == 5


@pytest.mark.long
def test_one_worker_draws_in_the_process_itself_and_two_draw_the_same_bytes(tmp_path, monkeypatch, rendered):
    write_days(tmp_path / "data", 2)
    with monkeypatch.context() as patch:
        patch.setattr(Processes, "submit", None)
        run(tmp_path / "data", tmp_path / "1", Config(), Options(workers=1))
    run(tmp_path / "data", tmp_path / "2", Config(), Options(workers=2))
    one, two = ({p.name: p.read_bytes() for p in (tmp_path / n / "figures").iterdir()} for n in "12")
    assert len(one) == 9 and one == two
    assert (tmp_path / "1" / "report.html").read_bytes().count(b"data:image/png") == 9


@pytest.mark.long
def test_a_command_whose_workers_draw_does_not_load_matplotlib(tmp_path):
    write_days(tmp_path / "data", 2)
    words = ["run", str(tmp_path / "data"), "--out", str(tmp_path / "out"), "--workers", "2", "-q"]
    code = (
        "import sys\nfrom rivid.cli import cli\n"
        f"cli.main({words}, standalone_mode=False)\n"
        "print('matplotlib' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1:] == ["False"], done.stdout + done.stderr
    assert list((tmp_path / "out" / "figures").glob("tdr_posterior.png"))


@pytest.mark.parametrize("engine", ["processes", pytest.param("dask", marks=pytest.mark.long)])
def test_nothing_is_imported_from_the_current_directory(engine, tmp_path):
    write_days(tmp_path / "data", 4)
    (tmp_path / "here" / "rivid").mkdir(parents=True)
    for name in ("numpy", "pyarrow", "rivid/batch", "sitecustomize"):
        (tmp_path / "here" / f"{name}.py").write_text(f"open({str(tmp_path / 'taken')!r}, 'w')\n")
    rivid = Path(sys.executable).with_name("rivid")
    words = [rivid, "run", tmp_path / "data", "--out", tmp_path / "out", "--quiet", "--no-figures"]
    done = subprocess.run(
        [*words, "--workers", "2", "--engine", engine],
        cwd=tmp_path / "here", capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert not (tmp_path / "taken").exists()
    assert (tmp_path / "out" / "delays.csv").exists()


def test_new_files_of_many_days_are_listed_by_the_engine_with_the_same_results(tmp_path, monkeypatch):
    class Two(Engine):
        slots = 2
        tasks: list = []

        def submit(self, task, *arguments):
            self.tasks.append(task)
            return super().submit(task, *arguments)

    write_days(tmp_path / "single", 6)
    texts = [path.read_text().split("\n", 1) for path in sorted((tmp_path / "single").glob("*.csv"))]
    data = tmp_path / "data"
    data.mkdir()
    for name, part in (("a", texts[:3]), ("b", texts[3:])):
        (data / f"{name}.csv").write_text(part[0][0] + "\n" + "".join(rows for _, rows in part))
    (data / "c.csv").write_text("no,log\n1,2\n")
    options, engine = Options(workers=1, figures=False), Two()
    alone = run(data, tmp_path / "alone", Config(), options)
    monkeypatch.setattr("rivid.run.run.LISTED_HERE", 0)
    shared = run(data, tmp_path / "shared", Config(), options, engine=engine)
    assert [task.__name__ for task in engine.tasks].count("look_ahead") == 3
    assert shared.bad_files == alone.bad_files and len(alone.bad_files) == 1
    for name in ("delays.csv", "fir.parquet"):
        assert (tmp_path / "shared" / name).read_bytes() == (tmp_path / "alone" / name).read_bytes()
    engine.tasks.clear()
    run(data, tmp_path / "shared", Config(), options, engine=engine)
    assert [task.__name__ for task in engine.tasks] == [
        "look_ahead"
    ]  # of the bad file, which has no stored facts
