"""The directive `command-help`: the output of `infoset COMMAND --help`."""

from __future__ import annotations

from typing import Any, ClassVar

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from typer.testing import CliRunner


class CommandHelp(SphinxDirective):
    """The help of a command or a subcommand."""

    required_arguments = 1
    optional_arguments = 1
    final_argument_whitespace: ClassVar[bool] = False

    def run(self) -> list[nodes.Node]:
        """Return the text as a literal block."""
        from experiments.cli import app

        environment = {"COLUMNS": "88", "TERMINAL_WIDTH": "88", "NO_COLOR": "1"}
        done = CliRunner().invoke(app, [*self.arguments, "--help"], env=environment)
        if done.exit_code:
            raise self.error(f"infoset {' '.join(self.arguments)} --help failed: {done.output}")
        text = "\n".join(line.rstrip() for line in done.output.splitlines()).strip("\n")
        block = nodes.literal_block(text, text, language="text", classes=["command-help"])
        return [block]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("command-help", CommandHelp)
    return {"version": "1", "parallel_read_safe": True}
