"""Put the pages of the docs into the wheel, but for those of measurements."""

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Docs(BuildHookInterface[Any]):
    """Map every file of ``docs`` but ``docs/measured`` to ``slipd/shipped/docs``."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the files, except to an editable installation, which reads them where they are."""
        docs = Path(self.root, "docs")
        if version != "editable":
            pages = [page.relative_to(docs) for page in docs.rglob("*") if page.is_file()]
            build_data["force_include"] |= {
                str(docs / page): f"slipd/shipped/docs/{page}" for page in pages if page.parts[0] != "measured"
            }
