"""Commands: a dataclass of options, and a function that runs them."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, TypeVar, get_type_hints

Options = TypeVar("Options")


def command(run: Callable[[Options], None]) -> Callable[..., None]:
    """Return the function that Typer registers for a function of one dataclass of options.

    The fields of the dataclass are the options and arguments of the command, declared with
    ``Annotated[type, typer.Option(...)]``; the docstring of the dataclass is the help text.

    Examples
    --------
    >>> @dataclass(frozen=True)
    ... class Greet:
    ...     \"\"\"Print a greeting.\"\"\"
    ...
    ...     name: Annotated[str, typer.Argument(help="Whom to greet.")] = "world"
    >>> @command
    ... def greet(options: Greet) -> None:
    ...     print("hello", options.name)
    """
    (options,) = (hint for name, hint in get_type_hints(run).items() if name != "return")
    hints = get_type_hints(options, include_extras=True)
    parameters = inspect.signature(options).parameters.values()

    def registered(**values: Any) -> None:
        run(options(**values))

    registered.__name__ = run.__name__
    # Typer keeps the line breaks of a docstring after its first paragraph.
    paragraphs = (inspect.getdoc(options) or "").split("\n\n")
    registered.__doc__ = "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)
    registered.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [each.replace(annotation=hints[each.name]) for each in parameters]
    )
    registered.__annotations__ = hints
    return registered
