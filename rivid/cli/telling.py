"""What a command says beside its answer: on stderr, more or less of it as --quiet and --verbose ask."""

import os
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import click

WIDTH = 80


def colour_wanted() -> bool | None:
    """False where colour is refused (NO_COLOR, a dumb terminal); None: on terminals only."""
    return False if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" else None


def complain(text: str) -> None:
    """A line on stderr about what is wrong."""
    from rivid.errors import printable

    line = " ".join(printable(text).split("\n"))
    click.echo(f"{click.style('rivid:', fg='red')} {line}", err=True, color=colour_wanted())


def wrapped(text: str, indent: int = 0, hanging: int = 2, width: int = WIDTH) -> str:
    """The text in lines of at most `width` columns; a path or a long word is left whole."""
    return textwrap.fill(
        text, width, initial_indent=" " * indent, subsequent_indent=" " * (indent + hanging),
        break_on_hyphens=False, break_long_words=False,
    )  # fmt: skip


def fitted(name: str, most: int = 40) -> str:
    """A name of at most `most` characters, its middle left out where it is longer.

    Examples
    --------
    >>> fitted("a-very-long-name-of-a-reach", 14)
    'a-very...reach'
    """
    if len(name) <= most:
        return name
    end = (most - 3) // 2
    return f"{name[: most - 3 - end]}...{name[len(name) - end :]}"


class Teller:
    """Notes on stderr, and the time by phase where --verbose asks for it.

    Parameters
    ----------
    quiet, verbose : bool
        One of them at most.

    Raises
    ------
    click.UsageError
        For both.
    """

    def __init__(self, quiet: bool = False, verbose: bool = False) -> None:
        if quiet and verbose:
            raise click.UsageError("--quiet and --verbose: leave out one of the two.")
        self.quiet, self.verbose = quiet, verbose
        self._since = time.perf_counter()

    def note(self, text: str) -> None:
        """A line, unless --quiet."""
        if not self.quiet:
            click.echo(f"rivid: {text}", err=True)

    def more(self, name: str, text: str) -> None:
        """A line of --verbose: a word and what stands behind it."""
        if self.verbose:
            click.echo(f"{name:>10}  {text}", err=True)

    def phase(self, name: str) -> None:
        """What has been done since the last call took this long."""
        now = time.perf_counter()
        if self.verbose:
            click.echo(f"{now - self._since:8.2f} s  {name}", err=True)
        self._since = now

    def timed(
        self, progress: Callable[[int], Any] | None, what: str = "data sets"
    ) -> Callable[[int], Any] | None:
        """The progress bar of a run; with --verbose, what comes before and during it is timed."""
        if not self.verbose:
            return progress

        @contextmanager
        def bar(total: int) -> Iterator[Callable[[int], Any]]:
            self.phase("finding what is new")
            with progress(total) if progress else nullcontext(lambda _: None) as done:
                yield done
            self.phase(f"estimating {total:,} {what}")

        return bar

    @contextmanager
    def steps(self, name: str) -> Iterator[Callable[[str], None]]:
        """Something is called before each step with what comes; `name` is the first, which has begun.

        On a terminal the line goes away when the next one comes; with --verbose each stays, timed.
        """
        on_terminal = sys.stderr.isatty() and not self.verbose
        under_way = name

        def step(text: str) -> None:
            nonlocal under_way
            if self.verbose:
                self.phase(under_way)
            elif not self.quiet:
                click.echo(f"{text:<78.78}\r" if on_terminal else text, err=True, nl=not on_terminal)
            under_way = text

        try:
            yield step
        finally:
            if on_terminal and not self.quiet:
                click.echo(" " * 78 + "\r", err=True, nl=False)
        self.phase(under_way)

    def begin(self, *places: tuple[str, "Path | str | None"]) -> None:
        """Versions, and the files and directories that are taken, by name."""
        if not self.verbose:
            return
        self.more("versions", versions())
        for name, place in places:
            if place is not None:
                self.more(name, str(place))
                if name == "logs":
                    self.more("", files_in(Path(place)))


def versions() -> str:
    """Of rivid, Python and what the figures and numbers come from; nothing is imported for it."""
    import platform
    from importlib.metadata import version

    from rivid import __version__

    others = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "pyarrow", "pydantic"))
    return f"rivid {__version__}, Python {platform.python_version()}, {others}"


def files_in(folder: Path) -> str:
    """How many files a directory holds, their size, the first and the last by name."""
    try:
        with os.scandir(folder) as entries:
            files = sorted((e.name, e.stat().st_size) for e in entries if e.is_file() and e.name[0] != ".")
    except OSError as error:
        return f"cannot be looked at: {error.strerror}"
    if not files:
        return "no files"
    ends = files[0][0] if len(files) == 1 else f"{files[0][0]} to {files[-1][0]}"
    return f"{len(files):,} file{'s' * (len(files) > 1)}, {sum(n for _, n in files) / 1e6:.1f} MB: {ends}"
