"""The commit that a report was measured at."""

from __future__ import annotations

import shutil
import subprocess


def measured_commit() -> str:
    """Its short name; with a + where files differ from it."""
    git = shutil.which("git")
    if git is None:
        return "unknown"
    told = subprocess.run([git, "describe", "--always", "--dirty=+"], capture_output=True, text=True, check=False)
    return told.stdout.strip() or "unknown"
