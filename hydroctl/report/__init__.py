"""The report page: one HTML file with the verdicts, maps and motions of a design, and an explorer
of its loop."""

from .page import write_report

__all__ = ["write_report"]
