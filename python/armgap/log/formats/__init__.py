"""Formats of logs: one file each, one line each in `FORMATS`."""

from armgap.log.formats.all import FORMATS, record
from armgap.log.formats.format import Format

__all__ = ["FORMATS", "Format", "record"]
