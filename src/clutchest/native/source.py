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

GENERATED = "clutchest_generated_"  # modules of this name are never edited


@dataclass(frozen=True, eq=False)
class Source:
    """A function and how it is compiled.

    ``contract``: a product and a sum may be rounded once; ``inline``: always inlined; ``apart``:
    no two of the arrays that it is given share memory, so that what is stored into one is read from
    no other; ``straight``: long and without loops, so that it takes too long to search it for what
    could go in parallel.
    """

    function: Callable[..., Any]
    contract: bool = False
    inline: bool = False
    apart: bool = False
    straight: bool = False

    @property
    def name(self) -> str:
        """Its name."""
        return self.code.co_name

    @property
    def how(self) -> tuple[bool, ...]:
        """All that is said of how it is compiled."""
        return self.contract, self.inline, self.apart, self.straight

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
        """Its syntax tree.  Raises Unsupported where its text is not known, or not any more."""
        file = self.code.co_filename
        linecache.checkcache(file)
        text = "".join(linecache.getlines(file, self.names))
        found = _definitions(text).get(self.name)
        if found is None:
            raise Unsupported(f"no text of '{self.name}' in {file}")
        if not self.names["__name__"].startswith(GENERATED) and not self._is(_codes(text)):
            raise Unsupported(f"'{self.name}' in {file} has changed since it was loaded")
        return found

    def _is(self, codes: dict[str, CodeType]) -> bool:
        """Whether it is one of these, under its name."""
        code, found = self.code, codes[self.name]
        return (found.co_code, repr(found.co_consts)) == (code.co_code, repr(code.co_consts))


@lru_cache(maxsize=16)
def _definitions(text: str) -> dict[str, ast.FunctionDef]:
    try:
        parts = ast.parse(text).body
    except SystemError:  # CPython's, where the garbage collector ran within (its issue 106905)
        parts = ast.parse(text).body
    return {part.name: part for part in parts if isinstance(part, ast.FunctionDef)}


@lru_cache(maxsize=16)
def _codes(text: str) -> dict[str, CodeType]:
    constants = compile(text, "", "exec", dont_inherit=True).co_consts
    return {code.co_name: code for code in constants if isinstance(code, CodeType)}
