"""Time processes and functions side by side, in one run, on a machine with other load."""

import json
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

PYTHON = sys.executable


@dataclass(frozen=True)
class Usage:
    """Resources of a command, including all processes that it starts.

    Wall time until it ends, total processor time, and the memory of the largest process. `own_mb` is the
    memory of the command itself.
    """

    seconds: float
    cpu: float
    peak_mb: float
    own_mb: float


LAUNCHER = """
import ctypes, json, os, resource, subprocess, sys, tempfile, time
if sys.platform == "linux":
    ctypes.CDLL(None).prctl(36, 1)  # processes left behind become children of this one, and are counted
began = time.perf_counter()
messages = tempfile.TemporaryFile()
child = subprocess.Popen(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=messages)
_, status, own = os.wait4(child.pid, 0)
seconds = time.perf_counter() - began
while True:
    try:
        os.wait()
    except ChildProcessError:
        break
usage = resource.getrusage(resource.RUSAGE_CHILDREN)
cpu = usage.ru_utime + usage.ru_stime
messages.seek(0)
messages = messages.read().decode()
print(json.dumps([os.waitstatus_to_exitcode(status), seconds, cpu, usage.ru_maxrss, own.ru_maxrss, messages]))
"""
"""Intermediate process. The system reports the peak memory of a child as at least that of the process that
started it, so the launcher must be small."""


def process(command: Sequence[str]) -> Usage:
    """Run a command to its end. The peak memory is that of its largest process."""
    surroundings = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    words = [PYTHON, "-I", "-S", "-c", LAUNCHER, *command]
    answer = subprocess.run(words, capture_output=True, text=True, env=surroundings, check=True).stdout
    code, seconds, cpu, peak_kb, own_kb, messages = json.loads(answer)
    if code != 0:
        raise SystemExit(f"{' '.join(command)} failed:\n{messages}")
    return Usage(seconds, cpu, peak_kb / 1024, own_kb / 1024)


def in_turn(
    commands: dict[str, Sequence[str]], runs: int, before: Callable[[str], None]
) -> dict[str, list[Usage]]:
    """Run commands in the order A B A B ..., so that load on the machine affects all of them equally."""
    usages: dict[str, list[Usage]] = {name: [] for name in commands}
    for turn in range(runs + 1):
        for name, command in commands.items():
            before(name)
            usage = process(command)
            if turn:  # the first turn fills the file cache
                usages[name].append(usage)
    return usages


def functions_in_turn(functions: dict[str, Callable[[], object]], runs: int) -> dict[str, list[float]]:
    """Return the seconds of each call, with the functions in turn."""
    seconds: dict[str, list[float]] = {name: [] for name in functions}
    for turn in range(runs + 1):
        for name, function in functions.items():
            began = time.perf_counter()
            function()
            if turn:
                seconds[name].append(time.perf_counter() - began)
    return seconds


def median(values: Sequence[float]) -> float:
    """Return the median."""
    return statistics.median(values)


def machine() -> str:
    """Describe the machine in one line."""
    model = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            model = next(line.split(":")[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return f"{model}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Format a Markdown table."""
    lines = ["| " + " | ".join(cells) + " |" for cells in (head, ["---"] * len(head), *rows)]
    return "\n".join(lines) + "\n"
