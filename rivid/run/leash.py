"""Imported first of all in the process that makes the workers: it does not outlive the run.

On Linux the kernel ends a process on this leash when the one that started it is gone; elsewhere a worker
looks for its parent itself (:mod:`rivid.run.workers`).
"""

import ctypes
import os
import signal
import sys

_PR_SET_PDEATHSIG = 1


def hold() -> None:
    """Have this process killed when its parent ends."""
    if sys.platform == "linux":
        parent = os.getppid()
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it went in between
            os._exit(1)


if os.environ.get("RIVID_LEASH"):
    hold()
