"""Reports: results, then sections, then HTML or a terminal."""

from armgap.report.html import render_html, write_html
from armgap.report.terminal import summary_table

__all__ = ["render_html", "summary_table", "write_html"]
