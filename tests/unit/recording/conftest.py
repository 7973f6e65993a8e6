from recorded_entries import about_run, entries, small_disk, two_pads, write

__all__ = ["about_run", "entries", "small_disk", "two_pads", "write"]
