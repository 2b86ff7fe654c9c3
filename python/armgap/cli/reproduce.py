"""``armgap reproduce``."""

from armgap.reproduction import command

__all__ = ["command"]
