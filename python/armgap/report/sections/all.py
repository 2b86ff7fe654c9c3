"""All sections of a diagnosis report, in their order; each is a function of the diagnosis as data."""

from __future__ import annotations

from collections.abc import Callable

from armgap.report.page import Section
from armgap.report.sections.about import data_quality, method
from armgap.report.sections.advice import what_next
from armgap.report.sections.causes import candidates, evidence, look_alikes, ranking, unnamed
from armgap.report.sections.chain import along_the_chain
from armgap.report.sections.checks import checks
from armgap.report.sections.gap import first_picture, gap_map
from armgap.report.sections.input import conventions
from armgap.report.sections.model_labels import Data
from armgap.report.sections.motion import free_run, horizons, predictions
from armgap.report.sections.parameters import parameters
from armgap.report.sections.silent import not_shown, ruled_out

__all__ = ["SECTIONS"]

SECTIONS: tuple[Callable[[Data], Section | None], ...] = (
    first_picture,
    conventions,
    checks,
    evidence,
    unnamed,
    predictions,
    gap_map,
    along_the_chain,
    ranking,
    candidates,
    look_alikes,
    parameters,
    not_shown,
    ruled_out,
    horizons,
    free_run,
    data_quality,
    method,
    what_next,
)
"""Functions of all report sections, in the order of the page; a function returns None for an empty section."""
