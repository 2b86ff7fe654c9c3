"""Reports of results: documents made of sections, shown as HTML, Markdown or in a terminal."""

from armgap.report.document import Document, diagnosis_document
from armgap.report.forms.html import render_html, write_html
from armgap.report.forms.terminal import summary_table
from armgap.report.output import check_report, diagnosis_report, prepare_report, render_report

__all__ = [
    "Document",
    "check_report",
    "diagnosis_document",
    "diagnosis_report",
    "prepare_report",
    "render_html",
    "render_report",
    "summary_table",
    "write_html",
]
