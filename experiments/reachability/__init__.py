"""Rendezvous through reachable sets: file, command, report, figures, page and printed numbers."""
