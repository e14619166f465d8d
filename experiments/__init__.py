"""What people run: the command line, scenarios, figures and files."""
