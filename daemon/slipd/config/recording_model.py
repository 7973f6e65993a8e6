"""Keys of ``[recording]``: where recordings are kept, and what is recorded without a request."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from slipd.config.bus_model import File
from slipd.config.value_bounds import StrictModel


class Continuous(StrictModel):
    """``[recording.continuous]``: the whole run, in files that follow each other; the oldest are deleted.

    Each file opens by itself. ``slipd run --record`` takes the place of this.

    Attributes:
        enabled: Record. Wrong: true on a memory card, and its few gigabytes an hour wear it out.
        file_s: Longest time in one file, s. Wrong: too small, and there are many files; too large, and much is deleted
            at once.
        file_bytes: Largest size of one file, bytes. Wrong: likewise.
        keep_files: Number of files that are kept. Wrong: too small, and what happened is deleted before anyone looks.
        keep_bytes: Size of all kept files together, bytes. Wrong: likewise; too large, and ``min_free_bytes`` ends the
            recording.
    """

    enabled: bool = False
    file_s: float = Field(default=600.0, ge=1.0, le=86_400.0)
    file_bytes: int = Field(default=200_000_000, ge=1_000_000)
    keep_files: int = Field(default=200, ge=2)
    keep_bytes: int = Field(default=10_000_000_000, ge=2_000_000)


class Incidents(StrictModel):
    """``[recording.incidents]``: the last seconds, always kept in memory, and saved after a warning or a drop.

    Attributes:
        enabled: Keep the last seconds, and save them. Wrong: false, and nobody can see why an object fell.
        before_s: Time before the warning that is saved, s. Wrong: too large, and the memory grows by about 0.3 MB for
            each second of two fingers.
        after_s: Time after the warning that is saved too, s. Wrong: too small, and the drop is missing.
        level: Least level that counts; the loss of a contact at that level counts too. A grasp that loses its object
            (``grasp.state`` "lost") always counts. Wrong: "caution" saves much that is harmless, "slipping" misses
            warnings that were heeded.
        pause_s: Least time between two savings after warnings, and between two after drops, s. Wrong: too small, and a
            chattering warning pushes out older files.
        keep_files: Number of files that are kept; the oldest are deleted. Wrong: too small, and an incident is deleted
            before anyone looks.
    """

    enabled: bool = False
    before_s: float = Field(default=60.0, ge=1.0, le=600.0)
    after_s: float = Field(default=5.0, ge=0.0, le=60.0)
    level: Literal["caution", "warning", "slipping"] = "warning"
    pause_s: float = Field(default=60.0, ge=1.0, le=86_400.0)
    keep_files: int = Field(default=20, ge=1)


class Recording(StrictModel):
    """``[recording]``: where recordings are kept, and limits of those that clients start.

    ``slipd run --record`` has no limits.

    Attributes:
        directory: Folder of all recordings but that of ``--record``, to which only this user can write; it is created.
            None: ``$SLIPD_STATE_DIR``, else ``$XDG_STATE_HOME/slipd``, else ``~/.local/state/slipd``. Wrong: on a
            network disk, and a lost network costs entries.
        max_bytes: Size of one file, bytes. A recording that reaches it is closed properly within 0.1 s. Wrong: too
            small, and a recording ends before what it should show.
        max_files: Number of files; at this number ``record.start`` is refused. No file is deleted. Wrong: too small,
            and `record.start` is refused.
        min_free_bytes: Free disk space, bytes; below it no recording starts, and a running one ends. Wrong: too small,
            and the disk fills up; too large, and nothing is recorded.
        continuous: See ``[recording.continuous]``. Wrong: see there.
        incidents: See ``[recording.incidents]``. Wrong: see there.
    """

    directory: File | None = None
    max_bytes: int = Field(default=1_000_000_000, ge=1_000_000)
    max_files: int = Field(default=20, ge=1)
    min_free_bytes: int = Field(default=1_000_000_000, ge=0)
    continuous: Continuous = Continuous()
    incidents: Incidents = Incidents()
