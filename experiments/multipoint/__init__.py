"""Visits to a sequence of moving targets: file, command, tables, figures, page and printed
numbers.
"""
