"""Pursuit-evasion on orbits: file, commands, report, figures, page and printed numbers."""
