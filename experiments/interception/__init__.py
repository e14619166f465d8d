"""The interception of an asteroid: files, commands, figures, page and printed numbers."""
