"""Padded text in a binary reply, such as a name or serial number."""

from __future__ import annotations


def strip_padding(data: bytes) -> str:
    """Return the text without padding spaces and zeros; "" if it is not printable ASCII."""
    text = data.decode("latin-1").strip(" \0")
    return text if text.isascii() and text.isprintable() else ""
