"""Observers of linear systems: file, command, figures and page."""
