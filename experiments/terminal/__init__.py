"""What can be looked at in a terminal, over ssh too."""
