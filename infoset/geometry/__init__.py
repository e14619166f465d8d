"""Convex polygons, zonotopes and polytopes."""
