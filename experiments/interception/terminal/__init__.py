"""Pictures of an engagement in a terminal."""
