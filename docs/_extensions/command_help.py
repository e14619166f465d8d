"""The directive `command-help`: a section for each command of `infoset`, with the output of
`--help`.
"""

from __future__ import annotations

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from typer.testing import CliRunner


class CommandHelp(SphinxDirective):
    """The help of all commands."""

    def run(self) -> list[nodes.Node]:
        """Return the sections, in the order of ``infoset --help``."""
        from infoset.experiments.cli import commands

        return [self._section(name, command) for name, command in commands().commands.items()]

    def _section(self, name: str, command: Any) -> nodes.section:
        """Return the section of a command; those of its subcommands are inside it."""
        from infoset.experiments.cli import app

        environment = {"COLUMNS": "88", "TERMINAL_WIDTH": "88", "NO_COLOR": "1"}
        done = CliRunner().invoke(app, [*name.split(), "--help"], env=environment)
        if done.exit_code:
            raise self.error(f"infoset {name} --help failed: {done.output}")
        text = "\n".join(line.rstrip() for line in done.output.splitlines()).strip("\n")
        section = nodes.section("", nodes.title("", "", nodes.literal("", f"infoset {name}")))
        section["names"].append(f"infoset {name}")
        self.state.document.note_implicit_target(section, section)
        section += nodes.literal_block(text, text, language="text", classes=["command-help"])
        section += [
            self._section(f"{name} {inner}", below)
            for inner, below in getattr(command, "commands", {}).items()
        ]
        return section


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("command-help", CommandHelp)
    return {"version": "1", "parallel_read_safe": True}
