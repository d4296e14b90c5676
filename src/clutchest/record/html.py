"""One page of HTML from a report in Markdown, its pictures inside.

Nothing is loaded from elsewhere: it can be mailed, opened without a network and printed.
"""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Mapping
from html import escape
from io import StringIO
from typing import TYPE_CHECKING

from clutchest import __version__

if TYPE_CHECKING:
    from clutchest.pictures import Picture

SHORT = 24  # characters of a table's cell that stay on one line
_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #1b1f24; max-width: 62rem; margin: 2rem auto;
       padding: 0 1.2rem; }
h1 { font-size: 1.6rem; margin-bottom: .2rem; } h2 { font-size: 1.2rem; margin-top: 2rem; }
table { border-collapse: collapse; margin: .8rem 0; font-variant-numeric: tabular-nums; }
th, td { border-bottom: 1px solid #d0d7de; padding: .25rem .7rem; text-align: left;
         vertical-align: top; }
.short { white-space: nowrap; } th { background: #f3f5f7; } img { max-width: 100%; height: auto; }
code, pre { font-family: ui-monospace, monospace; font-size: .9em; background: #f3f5f7; }
pre { padding: .6rem; overflow-x: auto; } footer { color: #59636e; margin-top: 3rem; }
@page { margin: 15mm; }
@media print { body { max-width: none; margin: 0; font-size: 11px; } h2 { break-after: avoid; }
               img, tr { break-inside: avoid; } img { max-height: 21cm; }
               footer { margin-top: 1rem; break-before: avoid; } }
"""


def page(title: str, markdown: str, pictures: Mapping[str, str] | None = None) -> str:
    """A whole document; where the text has ``![words](name)`` stands the picture of that name, as
    :func:`vector` or :func:`bitmap` give it.  HTML in the text is shown as it is written."""
    from markdown_it import MarkdownIt

    body = MarkdownIt("commonmark", {"html": False}).enable("table").render(markdown)
    for name, source in (pictures or {}).items():
        body = body.replace(f'src="{escape(name)}"', f'src="{source}"')
    body = re.sub(r'<img src="(?!data:)[^>]*>', "", body)
    body = re.sub(rf"<(t[dh])>(?=[^<]{{1,{SHORT}}}</\1>)", r'<\1 class="short">', body)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n{body}"
        f"<footer>clutchest {__version__}</footer>\n</body>\n</html>\n"
    )


def vector(picture: Picture) -> str:
    """A picture as the address of an image, as SVG."""
    file = StringIO()
    picture.savefig(file, format="svg")
    return _address("svg+xml", file.getvalue().encode())


def bitmap(png: bytes) -> str:
    """A PNG as the address of an image."""
    return _address("png", png)


def _address(kind: str, content: bytes) -> str:
    return f"data:image/{kind};base64,{b64encode(content).decode()}"
