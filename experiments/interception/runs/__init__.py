"""Runs of the commands: computation, files and tables."""
