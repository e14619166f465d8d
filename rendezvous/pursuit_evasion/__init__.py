"""The orbital pursuit-evasion game with free final time: solution, certificate, feedback and maps."""
