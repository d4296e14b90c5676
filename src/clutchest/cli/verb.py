"""How the help of a verb is laid out, and what it says of missing arguments."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from inspect import getdoc
from typing import Any

import click

from clutchest.cli.parameters import Positional, parameters_of
from clutchest.shipped import shipped


class Verbs(click.Group):
    """Commands in the order in which they are given."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """See :meth:`click.Group.list_commands`."""
        return list(self.commands)

    def invoke(self, ctx: click.Context) -> Any:
        """See :meth:`click.Group.invoke`; interrupted, it ends with the code that shells give."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            raise click.exceptions.Exit(130) from None


class Verb(click.Command):
    """A function as a command whose help shows arguments as they are typed, without their Python
    types, and that names all missing arguments at once."""

    def __init__(self, verb: Callable[..., None]) -> None:
        super().__init__(
            verb.__name__, callback=verb, params=parameters_of(verb), help=getdoc(verb)
        )

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """See :meth:`click.Command.parse_args`."""
        try:
            return super().parse_args(ctx, list(args))
        except click.BadParameter as problem:
            values, _, _ = self.make_parser(ctx).parse_args(args=list(args))
            given = {name: value for name, value in values.items() if _is_given(value)}
            missing = [p for p in self.get_params(ctx) if p.required and p.name not in given]
            if any(problem.param is parameter for parameter in missing):
                choices = [self.choices(str(p.name), given) for p in missing]
                names = ", ".join(map(_typed, missing))
                ctx.fail("; ".join([f"Missing: {names}", *filter(None, choices)]))
            raise

    def choices(self, name: str, given: Mapping[str, Any]) -> str:
        """What the missing argument ``name`` may be, beside those ``given``; empty if unknown."""
        return f"shipped vehicles: {', '.join(shipped('vehicles'))}" if name == "vehicle" else ""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """See :meth:`click.Command.format_options`."""
        parameters = self.get_params(ctx)
        arguments = [(str(p.metavar), p.words) for p in parameters if isinstance(p, Positional)]
        given = (p.get_help_record(ctx) for p in parameters if isinstance(p, click.Option))
        options = [record for record in given if record is not None]
        for title, rows in (("Arguments", arguments), ("Options", options)):
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)


def _typed(parameter: click.Parameter) -> str:
    """Its name as the help has it."""
    return str(parameter.metavar if isinstance(parameter, Positional) else parameter.opts[0])


def _is_given(value: Any) -> bool:
    """Whether the command line has it; for what it lacks the parser may have a marker."""
    return isinstance(value, str | bool) or (isinstance(value, list | tuple) and len(value) > 0)
