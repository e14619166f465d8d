"""Encounters of several craft: file, command, figures, page and printed numbers."""
