"""Logs: reading, naming of columns, and checks at the door."""

from armgap.log.log import Finding, Log

__all__ = ["Finding", "Log"]
