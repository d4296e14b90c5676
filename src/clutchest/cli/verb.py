"""How the help of a verb is laid out."""

from __future__ import annotations

from typing import Any

from typer.core import TyperCommand


class Verb(TyperCommand):
    """A command whose help shows arguments as they are typed, without their Python types."""

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
