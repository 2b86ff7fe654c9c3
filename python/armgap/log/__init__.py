"""Logs: reading, naming of columns, and checks at the door."""

from armgap.log.findings import Finding
from armgap.log.gather import gather, paths
from armgap.log.log import Log

__all__ = ["Finding", "Log", "gather", "paths"]
