"""Figures as files: PNG or SVG, written whole or not at all, the same bytes for the same figure."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from ..errors import InputError, unknown_name
from ..files import write_file
from .style import styled

_PNG_DPI = 144


FORMATS = ("png", "svg")


@styled
def save_figure(
    figure: Figure, directory: str | Path, name: str, *, formats: Sequence[str] = FORMATS
) -> list[Path]:
    """Write `figure` to `name`.png and `name`.svg, or one of them, in `directory`, which exists.
    Returns the paths.

    Raises InputError for another format, and as `write_file`. A file takes one drawing of the
    figure; `Figure.savefig` takes two.
    """
    if faults := [unknown_name("format", each, FORMATS) for each in formats if each not in FORMATS]:
        raise InputError(faults)
    return [
        write_file(Path(directory) / f"{name}.{each}", _DRAW[each](figure, name))
        for each in formats
    ]


def save_figures(
    figures: Mapping[str, Callable[[], Figure]],
    directory: str | Path,
    *,
    formats: Sequence[str] = FORMATS,
) -> list[Path]:
    """Draw and write the figures one after the other, as `save_figure`, keeping none. Returns all
    paths."""
    return [
        path
        for name, draw in figures.items()
        for path in save_figure(draw(), directory, name, formats=formats)
    ]


def _png(figure: Figure, name: str) -> bytes:
    file = io.BytesIO()
    figure.set_dpi(_PNG_DPI)
    FigureCanvasAgg(figure).print_png(
        file, metadata={"Software": None, "Title": name}, pil_kwargs={"compress_level": 1}
    )
    return file.getvalue()


def _svg(figure: Figure, name: str) -> bytes:
    file = io.BytesIO()
    FigureCanvasSVG(figure).print_svg(
        file, metadata={"Date": None, "Creator": "hydroctl", "Title": name}
    )
    return file.getvalue()


_DRAW = {"png": _png, "svg": _svg}
