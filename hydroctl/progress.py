"""What a terminal shows of long work, and what stays of it when it is interrupted."""

from __future__ import annotations

import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import typer

_PATIENCE = 2.0
"""s of work before progress is shown"""


@contextmanager
def interruptible(directory: Path | None) -> Iterator[Path]:
    """Where finished cases are kept: `directory`, or a temporary one that only an interrupt leaves
    behind. An interrupt ends the program with 130 and one line that says how to go on.
    """
    resumable = directory is not None
    kept = directory or Path(tempfile.mkdtemp(prefix="hydroctl-"))
    try:
        yield kept
    except KeyboardInterrupt:
        resumable = True
        typer.echo(
            f"hydroctl: interrupted; the same command with -o {kept} goes on from the finished"
            " cases",
            err=True,
        )
        raise typer.Exit(130) from None
    finally:
        if not resumable:
            shutil.rmtree(kept, ignore_errors=True)


@contextmanager
def progress_bar() -> Iterator[Callable[[int, int], None]]:
    """Gives the callback (done, count) of long work: after two seconds it draws a bar on stderr, if
    that is a terminal."""
    start, bar = time.monotonic(), None
    with ExitStack() as stack:

        def advance(done: int, count: int) -> None:
            nonlocal bar
            if bar is None and sys.stderr.isatty() and time.monotonic() - start >= _PATIENCE:
                bar = stack.enter_context(typer.progressbar(length=count, file=sys.stderr))
            if bar is not None:
                bar.update(done - bar.pos)

        yield advance


@contextmanager
def stage_bar(count: int) -> Iterator[Callable[[str], None]]:
    """Gives the callback (name) of the stages of long work, as each begins: on stderr, if a
    terminal, a bar that names it."""
    if not sys.stderr.isatty():
        yield lambda name: None
        return
    with typer.progressbar(length=count, file=sys.stderr, show_eta=False) as bar:

        def begin(name: str) -> None:
            bar.update(1 if bar.label else 0)
            bar.label = f"{name:<34}"
            bar.render_progress()

        yield begin
        bar.update(count - bar.pos)
