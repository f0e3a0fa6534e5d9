"""Runs as processes, to be killed, stopped and observed."""

import os
import random
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import psutil

WORDS = [sys.executable, "-m", "rivid"]
GONE_WITHIN = 2.0
"""Time within which all processes of a run must end [s]."""


def start(*words, **options):
    """Start the command; its stderr is kept."""
    given = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True} | options
    return subprocess.Popen([*WORDS, *map(str, words)], **given)


def family(child):
    """Return all processes that the child has started by now."""
    try:
        return psutil.Process(child.pid).children(recursive=True)
    except psutil.NoSuchProcess:
        return []


def end(child, number):
    """Send a signal and wait; return the exit code, the seconds, and the remaining processes."""
    others = family(child)
    child.send_signal(number)
    began = time.monotonic()
    code = child.wait(timeout=30)
    seconds = time.monotonic() - began
    alive = remaining(others)
    if child.stderr:
        child.stderr.close()
    return code, seconds, alive


def remaining(others):
    """Return the processes that still run after the time limit; a zombie is dead and only waits for init."""

    def runs(process):
        try:
            return process.status() != psutil.STATUS_ZOMBIE
        except psutil.NoSuchProcess:
            return False

    wait_until(lambda: not any(map(runs, others)), GONE_WITHIN)
    return [process for process in others if runs(process)]


def wait_until(true, seconds=60.0):
    """Wait for a condition; return whether it was reached."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if true():
            return True
        time.sleep(0.005)
    return bool(true())


def is_locked(path: Path) -> bool:
    """Return whether a process holds a lock on the file, from the kernel, without touching the lock."""
    try:
        inode = path.stat().st_ino
    except FileNotFoundError:
        return False
    return any(line.split()[5].endswith(f":{inode}") for line in Path("/proc/locks").read_text().splitlines())


@contextmanager
def forked(action):
    """Run `action` in a fork of this process; return its exit code, negative for a signal."""
    pid = os.fork()
    if pid == 0:
        try:
            action()
            os._exit(0)
        except BaseException:
            os._exit(1)
    yield os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def moments(seed, n, first, last):
    """Draw random moments [s] for an event during a run."""
    dice = random.Random(seed)
    return [dice.uniform(first, last) for _ in range(n)]


STOP, KILL = signal.SIGSTOP, signal.SIGKILL
