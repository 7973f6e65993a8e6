"""The commit and the machine that a report was measured at."""

from __future__ import annotations

import datetime
import os
import platform
import shutil
import subprocess


def measured_commit() -> str:
    """Its short name; with a + where files differ from it."""
    git = shutil.which("git")
    if git is None:
        return "unknown"
    told = subprocess.run([git, "describe", "--always", "--dirty=+"], capture_output=True, text=True, check=False)
    return told.stdout.strip() or "unknown"


def measured_on(*versions: str) -> str:
    """Commit, machine, Python, further ``versions``, cores, load and date, for the head of a report."""
    load = " ".join(f"{value:.2f}" for value in os.getloadavg())
    today = datetime.datetime.now(datetime.UTC).date()
    return (
        f"Commit {measured_commit()}, {platform.system()} {platform.machine()}, "
        f"{', '.join((f'Python {platform.python_version()}', *versions))}, "
        f"{os.cpu_count()} cores, load average {load}, {today}"
    )
