"""Rendezvous of craft in orbit: minimum energy, reachable sets, pursuit."""
