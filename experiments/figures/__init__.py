"""Pictures made from results; nothing here computes."""
