"""Test full disks, limits of file sizes, and write-protected places: a one-line error, nothing partial."""

import os
import resource
import signal
import subprocess
import time

import pytest

import rivid.run.run as running
from rivid.atomic import replacing
from rivid.config import Config
from rivid.errors import RividError
from rivid.run.run import Options, run
from tests.daily import write_days
from tests.faults.processes import WORDS, wait_until
from tests.faults.test_kills import QUICK
from tests.run.test_run import bytes_of, command

MOUNT = ["unshare", "--mount"] if os.getuid() == 0 else ["unshare", "--mount", "--map-root-user"]
"""A mount in its own namespace: it is invisible to other processes, and ends with its own."""


@pytest.fixture(scope="module")
def season(tmp_path_factory):
    folder = tmp_path_factory.mktemp("season")
    write_days(folder / "data", 20)
    run(folder / "data", folder / "whole", Config(), QUICK)
    return folder / "data", bytes_of(folder / "whole")


@pytest.fixture(scope="module")
def may_mount(tmp_path_factory):
    """Return whether the system permits a mount."""
    words = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(tmp_path_factory.mktemp("try"))]
    try:
        return subprocess.run([*MOUNT, *words], capture_output=True).returncode == 0
    except FileNotFoundError:
        return False


def limited(size):
    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)

    return limit


def one_line(done, *words):
    """Return the message of a failed command."""
    assert done.returncode == 1, done.stderr
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert all(word in done.stderr for word in words), done.stderr
    return done.stderr


@pytest.mark.parametrize(
    "size", [9_000, *(pytest.param(size, marks=pytest.mark.long) for size in (0, 40_000))]
)
def test_a_file_size_limit_anywhere(season, tmp_path, tried, size, rendered):
    data, whole = season
    out = tmp_path / "out"
    figures = ["--no-figures"] if size < 40_000 else []
    one_line(command("run", data, "--out", out, *figures, preexec_fn=limited(size)), "File too large")
    assert not list(out.rglob("*.part"))
    assert command("run", data, "--out", out, "--no-figures").returncode == 0
    assert bytes_of(out) == whole
    tried(f"RLIMIT_FSIZE = {size:,} bytes; then again without it")


@pytest.mark.long
def test_a_limit_met_by_the_workers(season, tmp_path, tried):
    data, whole = season
    out = tmp_path / "out"
    words = ("run", data, "--out", out, "--no-figures", "--workers", 2)
    one_line(command(*words, preexec_fn=limited(4_000)), "cannot write", "File too large")
    assert not list(out.rglob("*.part"))
    assert command(*words).returncode == 0
    assert bytes_of(out) == whole
    tried("RLIMIT_FSIZE of two workers; then again without it")


def write_for_ever(place, sign):
    with replacing(place) as scratch:
        scratch.write_bytes(b"half")
        sign.touch()
        time.sleep(60)


def fail_after(sign):
    assert wait_until(sign.exists)
    raise RividError("cannot write: File too large")


def test_a_worker_that_writes_while_another_fails_leaves_nothing_partial(
    season, tmp_path, monkeypatch, tried
):
    def batches(_, segments, engine, done):
        sign = tmp_path / "sign"
        engine.submit(write_for_ever, segments / "x.parquet", sign)
        engine.submit(fail_after, sign).result()

    monkeypatch.setattr(running, "run_batches", batches)
    out = tmp_path / "out"
    with pytest.raises(RividError, match="File too large"):
        run(season[0], out, Config(), Options(figures=False, workers=2))
    assert (tmp_path / "sign").exists() and not list(out.rglob("*.part"))
    tried("a worker that is writing while another fails")


FULL = """
mount -t tmpfs -o size=1m tmpfs "$1" || exit 90
out="$1/out"; copy="$2"; left="$3"; shift 3
mkdir "$out"
head -c $((1048576 - left)) /dev/zero > "${out%/out}/ballast" 2> /dev/null
"$@" --out "$out"
code=$?
find "$out" -name '*.part' -exec echo partial {} \\;
rm "${out%/out}/ballast"
"$@" --out "$out" >&2 || exit 91
cp -r "$out" "$copy"
exit $code
"""


@pytest.mark.parametrize("left", [pytest.param(0, marks=pytest.mark.long), 20_000])
def test_a_full_disk(season, tmp_path, tried, may_mount, left):
    data, whole = season
    words = [*WORDS, "run", str(data), "--no-figures", "--quiet"]
    if may_mount:
        (tmp_path / "disk").mkdir()
        places = [str(tmp_path / "disk"), str(tmp_path / "copy"), str(left)]
        done = subprocess.run(
            [*MOUNT, "sh", "-c", FULL, "sh", *places, *words], capture_output=True, text=True
        )
        one_line(done, "No space left on device")
        assert done.stdout == "", "something partial was left"
        assert bytes_of(tmp_path / "copy") == whole
        tried(f"a tmpfs of 1 MB with {left:,} bytes left; then again with room")
    else:
        out = ["--out", str(tmp_path / "out")]
        done = subprocess.run([*words, *out], capture_output=True, text=True, preexec_fn=limited(left // 8))
        one_line(done, "File too large")
        assert not list((tmp_path / "out").rglob("*.part"))
        assert subprocess.run([*words, *out]).returncode == 0
        assert bytes_of(tmp_path / "out") == whole
        tried(f"RLIMIT_FSIZE = {left // 8:,} bytes (no mount is allowed here); then again without it")


READ_ONLY = 'mount -t tmpfs -o ro tmpfs "$1" && shift && exec "$@"'


def test_out_on_a_read_only_disk_is_refused_before_any_work(season, tmp_path, tried, may_mount):
    place = tmp_path / "disk"
    place.mkdir()
    words = [*WORDS, "run", str(season[0]), "--out", str(place / "below")]
    if may_mount:
        words, what = [*MOUNT, "sh", "-c", READ_ONLY, "sh", str(place), *words], "OUT on a read-only mount"
    elif os.getuid() != 0:
        place.chmod(0o500)
        what = "OUT in a directory without the right to write (no mount is allowed here)"
    else:
        words[-1], what = "/sys/rivid", "OUT in sysfs (no mount is allowed here)"
    done = subprocess.run(words, capture_output=True, text=True)
    one_line(done, "cannot write to", "choose another --out")
    tried(what)


def test_out_that_can_be_no_directory(season, tmp_path, tried):
    (tmp_path / "file").write_text("kept")
    for place in (tmp_path / "file", tmp_path / "file" / "out", "/dev/full"):
        one_line(command("run", season[0], "--out", place), "cannot write to")
    assert (tmp_path / "file").read_text() == "kept"
    tried("OUT is a file, below a file, a device", 3)


KNOWN = ["--config", "configs/basse_isere.toml"]  # without it, stderr has a note


def test_a_full_standard_output(season, tmp_path, tried):
    data, out = str(season[0]), str(tmp_path / "out")
    for words in (["check", data], ["run", data, "--out", out, "--no-figures", *KNOWN], ["effects"]):
        with open("/dev/full", "w") as full:
            done = command(*words, stdout=full)
        one_line(done, "No space left on device")
    tried("/dev/full as standard output", 3)
