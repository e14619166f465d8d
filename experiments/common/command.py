"""Commands: a dataclass of options, and the module that runs them."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from importlib import import_module
from typing import Any, get_type_hints


def command(options: type, module: str) -> Callable[..., None]:
    """Return the function that Typer registers for a command.

    The module is imported when the command runs, so ``--help`` does not wait for it.

    Parameters
    ----------
    options : dataclass
        Its fields are the options and arguments, declared with ``Annotated[type, typer.Option(...)]``. Its docstring
        is the help text.
    module : str
        Name of the module whose function ``run`` takes the options.
    """
    hints = get_type_hints(options, include_extras=True)
    parameters = inspect.signature(options).parameters.values()

    def registered(**values: Any) -> None:
        import_module(module).run(options(**values))

    # Typer keeps the line breaks of a docstring after its first paragraph.
    paragraphs = (inspect.getdoc(options) or "").split("\n\n")
    registered.__doc__ = "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)
    registered.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [parameter.replace(annotation=hints[parameter.name]) for parameter in parameters]
    )
    registered.__annotations__ = hints
    return registered
