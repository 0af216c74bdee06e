"""Figures as files: PNG and SVG, written whole or not at all, the same bytes for the same figure."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from pathlib import Path

from matplotlib.figure import Figure

from ..files import write_file
from .style import styled

_METADATA = {"png": {"Software": None}, "svg": {"Date": None, "Creator": "hydroctl"}}


@styled
def save_figure(figure: Figure, directory: str | Path, name: str) -> tuple[Path, Path]:
    """Write `figure` to `name`.png and `name`.svg in `directory`, which exists. Returns both paths.

    Raises InputError as `write_file`. The figure's layout is settled here, once for both.
    """
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    written = []
    for kind, metadata in _METADATA.items():
        buffer = io.BytesIO()
        figure.savefig(buffer, format=kind, metadata=metadata | {"Title": name})
        written.append(write_file(Path(directory) / f"{name}.{kind}", buffer.getvalue()))
    return tuple(written)


def save_figures(figures: Mapping[str, Callable[[], Figure]], directory: str | Path) -> list[Path]:
    """Draw and write the figures one after the other, as `save_figure`, and let go of each. Returns all paths."""
    written = []
    for name, draw in figures.items():
        figure = draw()
        written += save_figure(figure, directory, name)
        figure.clear()
    return written
