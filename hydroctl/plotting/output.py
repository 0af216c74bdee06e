"""Figures as files: PNG and SVG, written whole or not at all, the same bytes for the same figure."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from ..files import write_file
from .style import styled

_PNG_DPI = 144


@styled
def save_figure(figure: Figure, directory: str | Path, name: str) -> tuple[Path, Path]:
    """Write `figure` to `name`.png and `name`.svg in `directory`, which exists. Returns both paths.

    Raises InputError as `write_file`. Each file takes one drawing of the figure; `Figure.savefig` takes two.
    """
    png, svg = io.BytesIO(), io.BytesIO()
    figure.set_dpi(_PNG_DPI)
    FigureCanvasAgg(figure).print_png(png, metadata={"Software": None, "Title": name}, pil_kwargs={"compress_level": 1})
    FigureCanvasSVG(figure).print_svg(svg, metadata={"Date": None, "Creator": "hydroctl", "Title": name})
    return tuple(write_file(Path(directory) / f"{name}.{kind}", file.getvalue()) for kind, file in (("png", png), ("svg", svg)))


def save_figures(figures: Mapping[str, Callable[[], Figure]], directory: str | Path) -> list[Path]:
    """Draw and write the figures one after the other, as `save_figure`, keeping none. Returns all paths."""
    return [path for name, draw in figures.items() for path in save_figure(draw(), directory, name)]
