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
"""Distance of a point from a half-space, 9.1e-13, up to which it is on its boundary.

It is used in the double description. A vertex is a combination of earlier vertices: after a
thousand roundings its coordinates are known to this.
"""
SNAP = 8.0 * ON
"""Thickness of a set that counts as flat, 7.3e-12, and distance of a facet from its vertices.

Two roundings of one facet are up to 8.5e-13 apart (random systems of three states): they are
merged.
"""
REDUCED = 2.0**12 * SNAP
"""Distance, 3.0e-8, of the two sides of a layer from the flat set that it replaces.

It is about the square root of the rounding, so that the layer stays thick. From this depth on a set
is certainly not flat, and a pivot of a matrix certainly not zero.
"""
