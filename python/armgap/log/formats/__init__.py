"""Readers of log formats: one file per format, listed in `FORMATS`."""

from armgap.log.formats.all import FORMATS, record
from armgap.log.formats.format import Format

__all__ = ["FORMATS", "Format", "record"]
