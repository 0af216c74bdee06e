"""Records, and equation (3) identified from them."""

from .identify import Identification, identify
from .records import Record, read_record

__all__ = ["Identification", "Record", "identify", "read_record"]
