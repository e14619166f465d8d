"""The commands of the interception."""
