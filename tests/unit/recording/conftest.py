from recorded_entries import about_run, entries, small_disk, write

__all__ = ["about_run", "entries", "small_disk", "write"]
