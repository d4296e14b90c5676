"""How the help of a verb is laid out, and what it says of missing arguments."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import typer
from typer.core import TyperCommand

from clutchest.shipped import shipped


class Verb(TyperCommand):
    """A command whose help shows arguments as they are typed, without their Python types, and that
    names all missing arguments at once."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """See :meth:`click.Command.parse_args`."""
        try:
            return super().parse_args(ctx, list(args))
        except typer.BadParameter as problem:
            given, _, _ = self.make_parser(ctx).parse_args(args=list(args))
            missing = [p for p in self.get_params(ctx) if p.required and not _given(p, given)]
            if any(problem.param is parameter for parameter in missing):
                choices = [self.choices(str(p.name), given) for p in missing]
                names = ", ".join(map(_typed, missing))
                ctx.fail("; ".join([f"Missing: {names}", *filter(None, choices)]))
            raise

    def choices(self, name: str, given: Mapping[str, Any]) -> str:
        """What the missing argument ``name`` may be, beside those ``given``; empty if unknown."""
        return f"shipped vehicles: {', '.join(shipped('vehicles'))}" if name == "vehicle" else ""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """See :meth:`click.Command.collect_usage_pieces`."""
        return [
            piece.replace("{", "").replace("}", "") for piece in super().collect_usage_pieces(ctx)
        ]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """See :meth:`click.Command.format_options`."""
        shown = [p for p in self.get_params(ctx) if not getattr(p, "hidden", False)]
        arguments = [
            (str(p.metavar), str(getattr(p, "help", "")))
            for p in shown
            if p.param_type_name == "argument"
        ]
        given = (p.get_help_record(ctx) for p in shown if p.param_type_name == "option")
        options = [record for record in given if record is not None]
        for title, rows in (("Arguments", arguments), ("Options", options)):
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)


def _typed(parameter: Any) -> str:
    """Its name as the help has it."""
    is_argument = parameter.param_type_name == "argument"
    return str(parameter.metavar if is_argument else parameter.opts[0])


def _given(parameter: Any, given: Mapping[str, Any]) -> bool:
    """Whether the command line has it; of what it lacks the parser may have a marker."""
    value = given.get(parameter.name)
    return isinstance(value, str) or (isinstance(value, list | tuple) and len(value) > 0)
