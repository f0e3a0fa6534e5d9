"""The command line: it translates options into a configuration and a result into an exit code.

One file per command, imported only when its command is called, so that ``rivid --help`` answers at once.
"""

import importlib
import os
import signal
import sys
from typing import Any

import click

from rivid import __version__
from rivid.errors import RividError, printable

COMMANDS = {
    "run": "Estimate every day of DATA_DIR that is new or changed.",
    "diagnose": "Find what a simulation of the reach still lacks.",
    "check": "Say what is wrong with the logs, without estimating.",
    "sniff": "Propose an [input] block for a foreign export.",
    "ingest": "Make daily logs of foreign exports.",
    "bounds": "Travel-time bounds of the reach, and what they propose.",
    "simulate": "Make daily logs of a simulated reach, and their truth.",
    "effects": "What a simulation may lack: the catalogue of effects.",
    "figures": "Redraw figures and report from stored results.",
    "fleet": "Say what is to be said of all reaches together.",
    "season": "Join the days of a run; the law of delay and discharge.",
}


class _Lazy(click.Group):
    def list_commands(self, context: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, context: click.Context, name: str) -> click.Command | None:
        if name not in COMMANDS:
            return None
        command = importlib.import_module(f"rivid.cli.{name}").command
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(cls=_Lazy, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="rivid")
def cli() -> None:
    """Identify a managed river reach from what its dams log every day.

    \b
    Exit codes: 0 all well; 1 failure; 2 usage or configuration; 3 days failed that had
    not failed before; 10 no data; 11 another run holds OUT; 130, 143 interrupted.
    """


class _Interrupted(BaseException):
    """SIGINT or SIGTERM came."""


_came: list[int] = []


def _interrupt(number: int, frame: Any) -> None:
    """Leave at once. Python drops an exception that falls into a destructor: the alarm raises it again."""
    if number != getattr(signal, "SIGALRM", None):
        _came.append(number)
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0.2)
    raise _Interrupted


def _listen() -> None:
    for name in ("SIGINT", "SIGTERM", "SIGALRM"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), _interrupt)


def _calm() -> None:
    """No more alarms: the way out is not interrupted."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0)


def main() -> None:
    """Entry point of the command ``rivid``."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # before numpy: days run side by side, one thread each
    _listen()
    try:
        try:
            code = _run()
            sys.stdout.flush()
        finally:
            _calm()
    except _Interrupted:
        code = 1
    except BrokenPipeError:
        code = _hush()
    except OSError as error:
        where = error.filename or "standard output"
        click.echo(f"rivid: {printable(str(where))}: {error.strerror or error}", err=True)
        code = _hush()
    sys.exit(128 + _came[0] if _came else code)


def _run() -> int:
    try:
        status = cli.main(standalone_mode=False)
        return status if isinstance(status, int) else 0
    except click.exceptions.Abort:
        return 1
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except RividError as error:
        click.echo(f"rivid: {printable(str(error))}", err=True)
        return error.exit_code


def _hush() -> int:
    """Nobody reads our stdout: spare them the interpreter's complaint about it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 1
