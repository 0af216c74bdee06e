"""What was shown of a schedule, and what was not."""

from .prove import prove

__all__ = ["prove"]
