"""Parts that all problems share: TOML files, options, screen, output, figures and pages."""
