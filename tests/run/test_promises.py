"""Regressions: earlier faults of `rivid run`."""

import datetime as dt
import json
import os
import shutil

import numpy as np
import pytest

from rivid.config import Config, load_config, parse
from rivid.errors import ConfigError
from rivid.estimators import Answer, Days
from rivid.results.read import load_results
from rivid.run.run import Options, _why, run
from tests.daily import write_days
from tests.run.test_run import bytes_of, command, rivid


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs") / "data"
    write_days(folder, 5)
    return folder


@pytest.fixture
def data(logs, tmp_path):
    return shutil.copytree(logs, tmp_path / "data")


def settings(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    return path


def dies(*_):
    raise KeyboardInterrupt


def test_tables_of_an_interrupted_run_with_other_settings_are_written_again(data, tmp_path, monkeypatch):
    out = tmp_path / "out"
    run(data, out, Config(), Options(figures=False))
    ours = bytes_of(out)
    other = parse({"jmap": {"sigma_d": 3.0}}, Config)

    monkeypatch.setattr("rivid.results.store.hashes", dies)  # right after the tables are replaced
    with pytest.raises(KeyboardInterrupt):
        run(data, out, other, Options(figures=False))
    monkeypatch.undo()
    assert bytes_of(out) != ours
    run(data, out, Config(), Options(figures=False))
    assert bytes_of(out) == ours


def test_damaged_files_of_out_are_found_and_written_again(data, tmp_path):
    out = tmp_path / "out"
    for name, damage, more in (
        ("delays.csv", "flip", ["--no-figures"]),
        ("fir.parquet", "cut", ["--no-figures"]),
        ("delays.parquet", "gone", ["--no-figures"]),
        ("figures/tdr_jmap.png", "cut", []),
    ):
        rivid("run", data, "--out", out, *more)
        path, before = out / name, bytes_of(out)
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 1
        if damage == "gone":
            path.unlink()
        else:
            path.write_bytes(bytes(content if damage == "flip" else content[:50]))
        code, output = rivid("run", data, "--out", out, *more)
        assert code == 0 and "0 estimated now" in output, name
        assert path.stat().st_size > 50 and bytes_of(out) == before, name


def test_a_failure_counts_as_new_until_a_finished_run_has_reported_it(data, tmp_path, monkeypatch):
    out = tmp_path / "out"
    (data / "2008-03-12.csv").write_text("time,u_Qi,u_Qo,h_L\n")

    monkeypatch.setattr("rivid.run.run.draw_with", dies)
    with pytest.raises(KeyboardInterrupt):
        run(data, out, Config(), Options())
    monkeypatch.undo()
    assert rivid("run", data, "--out", out)[0] == 3
    assert rivid("run", data, "--out", out)[0] == 0
    assert rivid("run", data, "--out", out, "--force")[0] == 0


def test_json_is_json_also_for_a_day_without_motion(data, tmp_path):
    path = data / "2008-03-12.csv"
    rows = [line.split(",") for line in path.read_text().splitlines()]
    path.write_text(
        "\n".join(",".join([r[0], "300" if i else r[1], *r[2:]]) for i, r in enumerate(rows)) + "\n"
    )
    _, output = rivid("run", data, "--out", tmp_path / "out", "--json", "--no-figures", "--quiet")

    def refuse(word):
        raise ValueError(word)

    lines = [json.loads(line, parse_constant=refuse) for line in output.splitlines()]
    assert lines[4]["status"] == "unidentifiable" and lines[4]["condition"] is None


def test_places_and_days_that_cannot_be_run(data, tmp_path):
    out, config = tmp_path / "out", settings(tmp_path, "c.toml", "[run]\nwindow_days = 9\n")
    assert rivid("run", data, "--out", data)[0] == 2 and not (data / ".rivid").exists()
    assert rivid("run", tmp_path / "none", "--out", out)[0] == 10 and not out.exists()
    for words in (("--from", "2030-01-01"), ("--from", "2008-03-14", "--to", "2008-03-11")):
        code, output = rivid("run", data, "--out", out, *words)
        assert code == 10 and "2008-03-10 to 2008-03-14" in output
    code, output = rivid("run", data, "--out", out, "--config", config)
    assert code == 10 and "window_days" in output


def test_days_without_logs_leave_the_tables(data, tmp_path):
    out = tmp_path / "out"
    command("run", data, "--out", out, "--no-figures")
    for day in ("10", "11"):
        (data / f"2008-03-{day}.csv").unlink()
    assert "2 days of earlier runs" in command("run", data, "--out", out, "--no-figures").stderr
    assert len(load_results(out).estimators[0].dates) == 3
    assert "earlier runs" not in command("run", data, "--out", out, "--no-figures").stderr


def test_another_directory_is_read_although_names_sizes_and_times_agree(data, tmp_path):
    other = shutil.copytree(data, tmp_path / "other" / "data")
    for path in other.iterdir():
        was = (data / path.name).stat()
        path.write_text(path.read_text().replace(",118.", ",119."))
        os.utime(path, ns=(was.st_atime_ns, was.st_mtime_ns))
    out = tmp_path / "out"
    rivid("run", data, "--out", out, "--no-figures")
    assert "5 estimated now" in rivid("run", other, "--out", out, "--no-figures")[1]


def test_dry_run_reads_without_writing(data, tmp_path):
    out = tmp_path / "out"
    rivid("run", data, "--out", out, "--no-figures", "--to", "2008-03-12")
    stamps = {p: p.stat().st_mtime_ns for p in out.rglob("*")}
    assert "2 to estimate" in rivid("run", data, "--out", out, "--dry-run")[1]
    assert {p: p.stat().st_mtime_ns for p in out.rglob("*")} == stamps
    assert rivid("run", data, "--out", out, "--dry-run", "--json")[0] == 2


def test_a_broken_note_of_files_is_no_obstacle(data, tmp_path):
    out = tmp_path / "out"
    rivid("run", data, "--out", out, "--no-figures")
    (out / ".rivid" / "segments" / "folder.parquet").mkdir()
    for content in ('{"2008-03-10.csv": 5}', "nonsense"):
        (out / ".rivid" / "files.json").write_text(content)
        assert "0 estimated now" in rivid("run", data, "--out", out, "--no-figures")[1]


def test_an_edited_record_is_no_obstacle(data, tmp_path):
    out = tmp_path / "out"
    (data / "bad.csv").write_text("no,log\n1,2\n")
    words = ("run", data, "--out", out, "--no-figures")
    assert rivid(*words)[0] == 3
    record = json.loads((out / "run.json").read_text())
    for damage in (None, 5, {}):
        edited = record | dict.fromkeys(("failed", "bad_files", "estimators"), damage)
        (out / "run.json").write_text(json.dumps(edited))
        assert rivid(*words)[0] == 3, "no run has reported the bad file"


def test_a_file_name_that_is_not_utf8_is_no_obstacle(data, tmp_path):
    with open(os.fsencode(data) + b"/d\xe9bit.csv", "wb") as file:
        file.write(b"x\n")
    done = command("run", data, "--out", tmp_path / "out", "--no-figures")
    assert done.returncode == 3
    assert "Traceback" not in done.stderr and "bit.csv" in done.stderr
    assert load_results(str(tmp_path / "out")).estimators[0].status == ["ok"] * 5


@pytest.mark.parametrize(
    ("text", "status", "messages"),
    [
        (
            "order = 640",
            "unidentifiable",
            ("order 640 is too long for 650 samples", "set [run] window_days = 2 or more"),
        ),
        ("max_iterations = 2", None, ("not settled after 2 rounds",)),
    ],
)
def test_a_message_names_the_setting_that_spoils_a_day(data, tmp_path, text, status, messages):
    config = settings(tmp_path, "c.toml", f"[jmap]\n{text}\n")
    for path in sorted(data.iterdir())[1:]:
        path.unlink()
    rivid("run", data, "--out", tmp_path / "out", "--config", config, "--no-figures")
    jmap, _ = load_results(tmp_path / "out").estimators
    assert all(words in jmap.messages[0] for words in messages) and status in (None, jmap.status[0])


@pytest.mark.parametrize(("order", "too_long"), [(300, True), (100, False)])
def test_a_response_too_long_for_the_window_of_a_river_is_the_reason(order, too_long):
    config = parse({"reach": {"kind": "river"}, "jmap": {"order": order, "d_max": 20}}, Config)
    u = np.sin(np.arange(700) / 500.0)[None]  # smooth: no response is identified
    answer = Answer(np.array(["unidentifiable"]), condition=np.array([1e15]))
    reason = _why(answer, 0, Days.of(u, u, None, 0.0), config)
    assert ("too long for 700 samples, of which 299 are history only" in reason) is too_long
    assert ("the inflow moves too little" in reason) is not too_long


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[reach]\nlength = 1e5\nsample_time = 10\n[jmap]\norder = 'bounds'\nd_max = 'bounds'\n", "the most"),
        ("[jmap]\nsigma_d = 1e-300\n", "jmap.sigma_d = 1e-300"),
        ("[jmap]\nsigma_d = 1e300\n", "jmap.sigma_d = 1e+300"),
        ("[jmap]\nalpha = 1e-300\n", "jmap.alpha"),
        ("[reach]\nlength = 1e300\n", "reach.length"),
        ("[jmap]\nsigma_d = 'x'\n", "jmap.sigma_d = 'x'"),
        ("[reach]\nsample_time = true\n", "reach.sample_time = True: true and false are no numbers"),
        ("[reach]\ndischarge_range = [true, 800]\n", "reach.discharge_range"),
        ("[input.interval]\nh_L = true\n", "input.interval"),
        ("[jmap]\norder = true\n", "jmap.order"),
        ("[run]\nwindow_days = true\n", "run.window_days"),
    ],
)
def test_what_is_no_number_or_out_of_range_is_refused_by_its_key(tmp_path, text, words):
    with pytest.raises(ConfigError) as caught:
        load_config(settings(tmp_path, "c.toml", text)).jmap_settings()
    assert words in str(caught.value) and "constrained" not in str(caught.value)


def test_a_toml_with_a_byte_order_mark_is_read(tmp_path):
    path = tmp_path / "c.toml"
    path.write_bytes(b"\xef\xbb\xbf[jmap]\nsigma_d = 9\n")
    assert load_config(path).jmap.sigma_d == 9


def test_without_a_zone_today_is_the_logs_own(tmp_path):
    """Half a day behind UTC, the current day is mostly a day earlier than in UTC."""
    data = tmp_path / "data"
    data.mkdir()
    zone = dt.timezone(dt.timedelta(hours=-12))
    here = dt.datetime.now(zone)
    midnight = dt.datetime.combine(here.date(), dt.time(), zone)
    rows = [
        f"{(midnight + dt.timedelta(seconds=133 * k)).isoformat()},{300 + k % 7},300,118" for k in range(40)
    ]
    (data / f"{here.date()}.csv").write_text("\n".join(["time,u_Qi,u_Qo,h_L", *rows]) + "\n")
    assert rivid("run", data, "--out", tmp_path / "out", "--no-figures")[0] == 0
    assert load_results(tmp_path / "out").estimators[0].status == ["pending"]
