"""A Python function as the compiler takes it."""

from __future__ import annotations

import ast
import linecache
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from types import CodeType
from typing import Any

from clutchest.native.types import Unsupported


@dataclass(frozen=True, eq=False)
class Source:
    """A function and how it is compiled.

    ``contract``: a product and a sum may be rounded once; ``inline``: always inlined.
    """

    function: Callable[..., Any]
    contract: bool = False
    inline: bool = False

    @property
    def name(self) -> str:
        """Its name."""
        return self.code.co_name

    @property
    def code(self) -> CodeType:
        """Its byte code."""
        code: CodeType = self.function.__code__
        return code

    @property
    def names(self) -> dict[str, Any]:
        """What the names in it stand for that are not its own."""
        return self.function.__globals__

    def definition(self) -> ast.FunctionDef:
        """Its syntax tree.  Raises Unsupported where its text is not known."""
        lines = linecache.getlines(self.code.co_filename, self.names)
        found = _definitions("".join(lines)).get(self.name)
        if found is None:
            raise Unsupported(f"no text of '{self.name}' in {self.code.co_filename}")
        return found


@lru_cache(maxsize=16)
def _definitions(text: str) -> dict[str, ast.FunctionDef]:
    tree = ast.parse(text)
    return {part.name: part for part in tree.body if isinstance(part, ast.FunctionDef)}
