"""Campaigns and sweeps: commands, tables, figures and clusters."""
