"""Logs: reading of files, mapping of columns to standard names and SI units, and checks."""

from armgap.log.findings import Finding
from armgap.log.gather import gather, paths
from armgap.log.log import Log

__all__ = ["Finding", "Log", "gather", "paths"]
