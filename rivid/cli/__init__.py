"""The command line: options -> configuration -> work -> summary -> exit code.

One file per command, imported only when its command is called, so that ``rivid --help`` answers at once.
"""

import errno
import importlib
import os
import signal
import sys
from contextlib import suppress
from typing import Any

import click

from rivid import __version__
from rivid.cli.console import colour_wanted, print_error
from rivid.errors import RividError, nearest

COMMANDS = {
    "run": "Estimate every day of DATA_DIR that is new or changed.",
    "diagnose": "Find the effects that a simulation of the reach lacks.",
    "forecast": "Forecast the next hours from a diagnosed model.",
    "check": "Report faults in the logs, without estimating.",
    "sniff": "Propose an [input] block for a foreign export.",
    "ingest": "Convert foreign exports to daily logs.",
    "bounds": "Travel-time bounds of the reach, and proposed delays.",
    "simulate": "Simulate daily logs of a reach with known truth.",
    "effects": "The catalogue of effects that a simulation may lack.",
    "figures": "Redraw figures and report from stored results.",
    "fleet": "Report on all reaches of a fleet together.",
    "season": "Join the days of a run; fit delay against discharge.",
    "publish": "Write the delays of a run to a database.",
    "export": "Write a model or delays for other software.",
    "completion": "Print the script that completes commands in a shell.",
}
"""Each command with its line in ``rivid --help``."""

BEGIN = """\
rivid: the delay of a managed river reach, day by day, from its dams' logs.

Start with these two; DATA_DIR holds one log per day:
  rivid check DATA_DIR    faults in the logs, without estimating
  rivid run DATA_DIR      estimate every day; the report is out/report.html

All commands: rivid --help. One of them: rivid run --help.
"""
"""Output of `rivid` without a command."""

_called: list[str] = []
"""The command under way, for the message after an interruption."""


class _Lazy(click.Group):
    """A group that imports a command when it is called."""

    def list_commands(self, context: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, context: click.Context, name: str) -> click.Command | None:
        if name not in COMMANDS:
            return None
        command: click.Command = importlib.import_module(f"rivid.cli.{name}").command
        command.short_help = COMMANDS[name]
        return command

    def resolve_command(
        self, context: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = args[0]
        if name not in COMMANDS and not name.startswith("-") and not context.resilient_parsing:
            context.fail(f"No such command {name!r}{nearest(name, COMMANDS)}")
        _called[:] = [name]
        return super().resolve_command(context, args)

    def format_commands(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(cls=_Lazy, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="rivid")
@click.pass_context
def cli(context: click.Context) -> int:
    """Identify a managed river reach from the daily logs of its dams.

    \b
    Examples:
      rivid check sample_data/basse_isere_csv
      rivid run sample_data/basse_isere --config configs/basse_isere.toml

    Without --config, rivid.toml is searched in DATA_DIR and its parent directories,
    up to the home directory or the root of the filesystem. The nearest one applies,
    and stderr names it. With [run] out in it, `rivid run DATA_DIR` needs no options.
    A file of another user, or one that everybody can write to, is refused.

    \b
    Exit codes: 0 all well; 1 failure; 2 usage or configuration; 3 days failed
    that had not failed before; 10 no data; 11 another run holds OUT; 130, 143
    interrupted. Colour: on terminals, unless NO_COLOR is set.
    """
    context.color = colour_wanted()
    if context.invoked_subcommand is None:
        click.echo(BEGIN, nl=False)
        return 2  # a usage error, as for a command without its arguments
    return 0


class _Interrupted(BaseException):
    """SIGINT or SIGTERM was received."""


_received: list[int] = []


def _interrupt(number: int, frame: Any) -> None:
    """Raise at once. Python drops an exception raised in a destructor: an alarm raises it again."""
    if number != getattr(signal, "SIGALRM", None):
        _received.append(number)
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0.2)
    raise _Interrupted


def _ignore_signals() -> None:
    """Ignore signals and stop the alarm, so that nothing interrupts the exit.

    When Python ends, it restores the system's handlers: a late signal would change the exit code.
    """
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


def _open_closed_streams() -> None:
    """Replace a closed stdout or stderr (``>&-``) by the null device, before a file takes its number."""
    for number, name in ((0, "stdin"), (1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            handle = os.open(os.devnull, os.O_RDWR)
            if handle != number:
                os.dup2(handle, number)
                os.close(handle)
            setattr(sys, name, open(number, "r" if number == 0 else "w", encoding="utf-8"))


def main() -> None:
    """Entry point of the command ``rivid``."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # before numpy: days are parallel, one thread each
    os.environ["MPLBACKEND"] = "agg"  # before matplotlib: that of a notebook or a typing error stops figures
    _open_closed_streams()
    for name in ("SIGINT", "SIGTERM", "SIGALRM"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), _interrupt)
    try:
        try:
            code = _run()
            sys.stdout.flush()
        finally:
            _ignore_signals()
    except _Interrupted:
        code = 1
    except BrokenPipeError:
        code = _silence_stdout()
    except OSError as error:
        if error.errno in (errno.EMFILE, errno.ENFILE):
            print_error("too many files are open at once: expected a limit of 64 or more: see `ulimit -n`")
        else:
            print_error(f"{error.filename or 'standard output'}: {error.strerror or error}")
        code = _silence_stdout()
    except Exception:  # compiled code may replace the exception of the signal by its own
        if not _received:
            raise
        code = 1
    if _received:
        code = 128 + _received[0]
        what = "interrupted" if _received[0] == signal.SIGINT else "ended by SIGTERM"
        kept = ": finished days are kept, the same command continues from there" if _called == ["run"] else ""
        with suppress(OSError, ValueError):  # stderr may be closed
            print_error(f"{what}{kept}")
    sys.exit(code)


def _run() -> int:
    try:
        code: int = cli.main(prog_name="rivid", standalone_mode=False)
        return code
    except click.UsageError as error:
        message = " ".join(error.format_message().split())
        message += "" if message.endswith((".", "?")) else "."
        print_error(f"{message} See `{error.ctx.command_path if error.ctx else 'rivid'} --help`.")
        return error.exit_code
    except RividError as error:
        print_error(str(error))
        return error.exit_code


def _silence_stdout() -> int:
    """Redirect stdout to the null device, so that the interpreter reports no error when it flushes."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 1
