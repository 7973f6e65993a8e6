"""Thin asyncio shells that move bytes between devices and the engine."""
