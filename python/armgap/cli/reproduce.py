"""``armgap reproduce``."""

from armgap.reproduce import command

__all__ = ["command"]
