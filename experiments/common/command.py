"""Commands: a dataclass of options, and the module that runs them."""

from __future__ import annotations

import copy
import inspect
import sys
from collections.abc import Callable
from functools import partial
from importlib import import_module
from types import NoneType
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import typer

from experiments.common.options import choice, read_number

LOADING = "loading ..."
EXAMPLE = 50
"""Number in a message about an option without a default, unless a number follows ``typer.Option(...)``."""


def command(options: type, module: str) -> Callable[..., None]:
    """Return the function that Typer registers for a command.

    The fields of the dataclass `options`, declared with ``Annotated[type, typer.Option(...)]``, are the options and
    arguments, and its docstring is the help text. The module, whose function ``run`` takes the options, is imported
    when the command runs, so ``--help`` does not wait for it.
    """
    parameters = inspect.signature(options).parameters.values()
    hints = get_type_hints(options, include_extras=True)
    hints = {parameter.name: _checked(parameter, hints[parameter.name]) for parameter in parameters}

    def registered(**values: Any) -> None:
        loaded(module, bool(values.get("quiet"))).run(options(**values))

    # Typer keeps the line breaks of a docstring after its first paragraph.
    paragraphs = (inspect.getdoc(options) or "").split("\n\n")
    registered.__doc__ = "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)
    registered.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [parameter.replace(annotation=hints[parameter.name]) for parameter in parameters]
    )
    registered.__annotations__ = hints
    return registered


def loaded(module: str, quiet: bool) -> Any:
    """Import a module, with a line on a terminal: it may take about a second."""
    shown = not quiet and sys.stderr.isatty()
    if shown:
        typer.echo(LOADING, nl=False, err=True)
    imported = import_module(module)
    if shown:
        typer.echo(f"\r{' ' * len(LOADING)}\r", nl=False, err=True)
    return imported


def _checked(parameter: inspect.Parameter, hint: Any) -> Any:
    """Return the annotation of an option with a parser for its numbers or names, whose messages have an example."""
    kind, info, *examples = get_args(hint)
    kinds = [part for part in (get_args(kind) if NoneType in get_args(kind) else [kind]) if part is not NoneType]
    option = info.default if isinstance(info.default, str) else f"--{parameter.name.replace('_', '-')}"
    info = copy.copy(info)
    if get_origin(kinds[0]) is Literal:
        info.parser = partial(choice, option, valid=get_args(kinds[0]))
    elif kinds[0] is bool:
        info.metavar = ""  # The help of a flag shows no type, because a flag has no value.
    elif kinds[0] in (int, float):
        default = parameter.default
        number = default if isinstance(default, kinds[0]) else max(info.min or 0, *examples or [EXAMPLE])
        limits = {"minimum": info.min, "maximum": info.max, "example": f"{option} {number}"}
        info.parser = partial(read_number, option, kinds[0], **limits)
    return Annotated[kind, info]
