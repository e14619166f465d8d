"""The figures of the interception."""
