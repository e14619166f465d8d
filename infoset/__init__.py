"""The set engine."""
