"""Numbers that stand beside each other in print: as many digits as what is said of them needs."""

from __future__ import annotations

import math

FEWEST = 6
"""significant digits of numbers that need no more, as in the format "g\""""
EXACT = 17
"""significant digits in which any two numbers of double precision differ"""


def apart(*values: float, digits: int = FEWEST, factor: float = 1.0) -> tuple[str, ...]:
    """`values` times `factor` (above 0) as texts that differ where the values differ.

    All have the same number of significant digits, the fewest that do it from `digits` on. Rounding
    to one number of digits keeps the order: what holds between the values holds between the texts.
    """
    scaled, different = _scaled(values, factor), len(set(values))
    for count in range(digits, EXACT):
        texts = tuple(f"{value:.{count}g}" for value in scaled)
        if len(set(texts)) == different:
            return texts
    return tuple(map(repr, scaled))


def _scaled(values: tuple[float, ...], factor: float) -> list[float]:
    """The products; where different values give one product, the larger gets the next number."""
    products, last = {}, math.nan
    for value in sorted(set(values)):
        product = float(value * factor)
        last = products[value] = math.nextafter(last, math.inf) if product <= last else product
    return [products[value] + 0.0 for value in values]
