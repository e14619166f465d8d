"""The set observer of a linear system."""
