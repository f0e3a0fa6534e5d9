"""The command line: it translates options into a configuration and a result into an exit code.

One file per command, imported only when its command is called, so that ``rivid --help`` answers at once.
"""

import importlib
import os
import signal
import sys
from contextlib import suppress
from typing import Any

import click

from rivid import __version__
from rivid.errors import RividError

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
    "completion": "The script that completes commands and options in a shell.",
}

BEGIN = """\
rivid: the delay of a managed river reach, day by day, from what its dams log.

Begin with these two; DATA_DIR holds a log of each day:
  rivid check DATA_DIR    what is wrong with the logs, without estimating
  rivid run DATA_DIR      estimate every day; the report is out/report.html

All commands: rivid --help. One of them: rivid run --help.
"""
"""What `rivid` alone says."""

_called: list[str] = []
"""The command that was asked for, for those who speak after its end."""


class _Lazy(click.Group):
    def list_commands(self, context: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, context: click.Context, name: str) -> click.Command | None:
        if name not in COMMANDS:
            return None
        command = importlib.import_module(f"rivid.cli.{name}").command
        assert isinstance(command, click.Command)
        return command

    def resolve_command(
        self, context: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = args[0]
        if name not in COMMANDS and not name.startswith("-") and not context.resilient_parsing:
            from rivid.cli.options import nearest

            context.fail(f"No such command {name!r}.{nearest(name, list(COMMANDS))}")
        _called[:] = [name]
        return super().resolve_command(context, args)

    def format_commands(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(
    cls=_Lazy,
    invoke_without_command=True,
    no_args_is_help=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(__version__, prog_name="rivid")
@click.pass_context
def cli(context: click.Context) -> int:
    """Identify a managed river reach from what its dams log every day.

    \b
    Examples:
      rivid check sample_data/basse_isere_csv
      rivid run sample_data/basse_isere --config configs/basse_isere.toml

    Without --config, rivid.toml is looked for in DATA_DIR and above it, as far as
    the home directory or the filesystem reach: the nearest counts, and stderr
    names it. With [run] out in it, `rivid run DATA_DIR` needs no options. One that
    another user owns, or that everybody may write to, is refused.

    \b
    Exit codes: 0 all well; 1 failure; 2 usage or configuration; 3 days failed
    that had not failed before; 10 no data; 11 another run holds OUT; 130, 143
    interrupted. Colour: on terminals, unless NO_COLOR is set.
    """
    from rivid.cli.console import colour_wanted

    context.color = colour_wanted()
    if context.invoked_subcommand is None:
        click.echo(BEGIN, nl=False)
        return 2  # as of any command that is called with too little
    return 0


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
    """No more alarms, and no signals: the way out is not interrupted.

    Python, when it ends, gives a signal that it handles back to the system: the code would be another.
    """
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0)
    for name in ("SIGINT", "SIGTERM"):
        signal.signal(getattr(signal, name), signal.SIG_IGN)


def main() -> None:
    """Entry point of the command ``rivid``."""
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")  # before numpy: days run side by side, one thread each
    _listen()
    try:
        from rivid.cli.console import print_error

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
        print_error(f"{error.filename or 'standard output'}: {error.strerror or error}")
        code = _hush()
    except Exception:  # compiled code may make one of its own of the signal's
        if not _came:
            raise
        code = 1
    if _came:
        code = 128 + _came[0]
        _say_interrupted()
    sys.exit(code)


def _say_interrupted() -> None:
    """One line, where somebody reads it."""
    from rivid.cli.console import print_error

    what = "interrupted" if _came[0] == signal.SIGINT else "ended by SIGTERM"
    kept = ": the days done are kept, the same command goes on from there" if _called == ["run"] else ""
    with suppress(OSError, ValueError):
        print_error(f"{what}{kept}")


def _run() -> int:
    from rivid.cli.console import print_error

    try:
        status = cli.main(prog_name="rivid", standalone_mode=False)
        return status if isinstance(status, int) else 0
    except click.exceptions.Abort:
        return 1
    except click.UsageError as error:
        said = " ".join(error.format_message().split())
        said += "" if said.endswith((".", "?")) else "."
        print_error(f"{said} See `{error.ctx.command_path if error.ctx else 'rivid'} --help`.")
        return error.exit_code
    except click.ClickException as error:
        print_error(error.format_message())
        return error.exit_code
    except RividError as error:
        print_error(str(error))
        return error.exit_code


def _hush() -> int:
    """Nobody reads our stdout: spare them the interpreter's complaint about it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 1
