"""What mkdocs does with the pages beside showing them: ``mkdocs build --strict``.

Links to files outside of this folder become the files' names, and ``::: clutchest`` the public
names with their docstrings.
"""

from __future__ import annotations

import inspect
import re
from typing import Any


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The page as the site shows it."""
    markdown = re.sub(r"\[(`?)([^\]`]+)`?\]\(\.\./[^)]*\)", r"`\2`", markdown)
    return markdown.replace("::: clutchest\n", _names())


def _names() -> str:
    """Every public name: signature and docstring."""
    import clutchest

    parts = []
    for name in clutchest.__all__:
        value = getattr(clutchest, name)
        if not callable(value):
            continue
        try:
            signature = str(inspect.signature(value))
        except ValueError:
            signature = "(…)"
        text = inspect.cleandoc(value.__doc__ or "").replace("``", "`")
        text = re.sub(r":\w+:`~?([^`]+)`", r"`\1`", text)
        parts.append(f"## {name}\n\n```python\n{name}{signature}\n```\n\n{text}\n")
    return "\n".join(parts)
