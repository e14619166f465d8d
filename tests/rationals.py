"""Exact rational numbers for independent checks: those of GMP, which are many times faster than
Python's.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fractions import Fraction
else:
    import gmpy2

    Fraction = gmpy2.mpq

__all__ = ["Fraction"]
