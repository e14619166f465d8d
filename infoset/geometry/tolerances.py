"""The tolerances of sets: five numbers, each a power of two times the one above it.

All of them are relative, to the terms of a sum or to coordinates in which a set is about one wide.
Other limits in this package are derived from these five.
"""

EPS = 2.0**-52
"""Spacing of the floats at one: twice the maximum rounding of one operation."""
UNSURE = 4.0 * EPS
"""Rounding of a computed number, relative to the sum of the sizes of its terms, for each term.

A product, a sum, a division and a step outward are rounded once each. A given row of constraints
that is shorter than the longest one by this factor is the rounding of a row that is zero.
"""
ON = 2.0**10 * UNSURE
"""Distance of a point from a half-space on whose boundary it lies, 9.1e-13, in the double
description.

A vertex is a combination of earlier ones: after a thousand roundings its coordinates are known to
this.
"""
SNAP = 8.0 * ON
"""Thickness, 7.3e-12, of what counts as flat, and distance from a facet of points that count as its
vertices.

Two roundings of one facet are up to 8.5e-13 apart (random systems of three states): they are
merged.
"""
REDUCED = 2.0**12 * SNAP
"""Thickness, 3.0e-8, of a layer in place of a flat set; about the square root of the rounding, so
that it stays thick.

Depth from which a set is certainly not flat, and the pivot of a matrix that is certainly not zero.
"""
