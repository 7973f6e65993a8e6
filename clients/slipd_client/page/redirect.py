"""Opens the page by way of a private file, so that its token is not in the arguments of the browser's process.

Every user of a machine can read those arguments. The file can be read by its owner only, and leads on to the page.
"""

from __future__ import annotations

import os
from html import escape
from pathlib import Path

_TEXT = """\
<!doctype html>
<meta charset="utf-8">
<meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0; url={url}">
<title>slipd</title>
<a href="{url}">The live view of slipd</a>
"""


def redirect_file(folder: Path, url: str) -> Path:
    """Write a file that leads a browser to ``url``, and return its path.

    Raises:
        OSError: The file exists already, or cannot be written.
    """
    path = folder / "view.html"
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as file:
        file.write(_TEXT.format(url=escape(url)))
    return path
