"""Visits to moving targets: file, command, tables, figures, page and printed numbers."""
