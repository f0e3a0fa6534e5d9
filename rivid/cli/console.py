"""Output on stderr beside a command's result: notes, errors, progress steps and phase times."""

import os
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rivid.errors import printable
from rivid.text import count

if TYPE_CHECKING:
    from rivid.run.workers import Progress

WIDTH = 80
"""Columns of all text output."""


def colour_wanted() -> bool | None:
    """Return False where NO_COLOR or a dumb terminal forbids colour, else None: on terminals only."""
    return False if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" else None


def print_error(text: str) -> None:
    """Print an error or a warning as one line on stderr."""
    line = printable(" ".join(text.split("\n")))
    click.echo(f"{click.style('rivid:', fg='red')} {line}", err=True, color=colour_wanted())


def wrap(text: str, indent: int = 0, hanging: int = 2) -> str:
    """Break text into lines of at most :data:`WIDTH` columns; paths and long words are not split."""
    return textwrap.fill(
        text, WIDTH, initial_indent=" " * indent, subsequent_indent=" " * (indent + hanging),
        break_on_hyphens=False, break_long_words=False,
    )  # fmt: skip


def abbreviate(name: str) -> str:
    """Shorten a name to 40 characters by leaving out its middle."""
    return name if len(name) <= 40 else f"{name[:19]}...{name[-18:]}"


class Console:
    """Notes on stderr, and the duration of each phase with --verbose.

    `quiet` and `verbose` are the options of these names; click.UsageError if both are given.
    """

    def __init__(self, quiet: bool = False, verbose: bool = False) -> None:
        if quiet and verbose:
            raise click.UsageError("--quiet and --verbose: leave out one of the two.")
        self.quiet, self.verbose = quiet, verbose
        self._since = time.perf_counter()

    def info(self, text: str) -> None:
        """Print a line, unless --quiet."""
        if not self.quiet:
            click.echo(f"rivid: {text}", err=True)

    def say(self, text: str) -> None:
        """Print a result on stdout, unless --quiet."""
        if not self.quiet:
            click.echo(text)

    def phase(self, name: str) -> None:
        """Print with --verbose how long the phase that ends here has taken."""
        now = time.perf_counter()
        if self.verbose:
            click.echo(f"{now - self._since:8.2f} s  {name}", err=True)
        self._since = now

    def progress(self, shown: bool, what: str) -> "Progress":
        """Return a bar for so many data sets or reaches; with --verbose, the phases around it are timed."""

        @contextmanager
        def timed(total: int) -> Iterator[Callable[[int], Any]]:
            self.phase("finding what is new")
            if shown and not self.quiet and sys.stderr.isatty():
                bar = click.progressbar(length=total, label="estimating", show_pos=True, file=sys.stderr)
                with bar:
                    yield bar.update
            else:
                yield lambda n: None
            self.phase(f"estimating {total:,} {what}")

        return timed

    @contextmanager
    def steps(self) -> Iterator[Callable[[str], None]]:
        """Yield a function to call with the name of each step as it begins; the first is "starting".

        After ten seconds, steps are shown with the time since the first one. A terminal shows the current
        step only; with --verbose, each step is printed with its duration.
        """
        on_terminal = sys.stderr.isatty() and not self.verbose and not self.quiet
        current, began = "starting", time.perf_counter()

        def step(text: str) -> None:
            nonlocal current
            past = time.perf_counter() - began
            so_far = f"{past:.0f} s" if past < 120.0 else f"{past / 60.0:.0f} min"
            end = f", {so_far} so far" if past >= 10.0 else ""
            if self.verbose and text != current:
                self.phase(current)
            elif on_terminal:
                shown = text[: WIDTH - 2 - len(end)] + end
                click.echo(f"{shown:<{WIDTH - 2}}\r", err=True, nl=False)
            elif text != current and not self.quiet:
                click.echo(text + end, err=True)
            current = text

        try:
            yield step
        finally:
            if on_terminal:
                click.echo(" " * (WIDTH - 2) + "\r", err=True, nl=False)
        self.phase(current)

    def begin(self, *places: tuple[str, Path | str | None]) -> None:
        """Print with --verbose the versions and the named files and directories in use."""
        if not self.verbose:
            return
        lines = [("versions", versions())]
        for name, place in places:
            if place is not None:
                lines.append((name, str(place)))
                lines += [("", files_in(Path(place)))] if name == "logs" else []
        for name, text in lines:
            click.echo(f"{name:>10}  {text}", err=True)


def versions() -> str:
    """Return the versions of rivid, Python and the numerical libraries, without importing them."""
    import platform
    from importlib.metadata import version

    from rivid import __version__

    others = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "pyarrow", "pydantic"))
    return f"rivid {__version__}, Python {platform.python_version()}, {others}"


def files_in(folder: Path) -> str:
    """Return the number of files in a directory, their size, and the first and last by name."""
    try:
        with os.scandir(folder) as entries:
            files = sorted((e.name, e.stat().st_size) for e in entries if e.is_file() and e.name[0] != ".")
    except OSError as error:
        return f"cannot be read: {error.strerror}"
    if not files:
        return "no files"
    ends = files[0][0] if len(files) == 1 else f"{files[0][0]} to {files[-1][0]}"
    return f"{count(len(files), 'file')}, {sum(n for _, n in files) / 1e6:.1f} MB: {ends}"
