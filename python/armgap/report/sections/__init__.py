"""The sections of a diagnosis report, in their order; each is a function of the diagnosis as data."""

from __future__ import annotations

from collections.abc import Callable

from armgap.report.page import Section
from armgap.report.sections.about import data_quality, method
from armgap.report.sections.causes import evidence, look_alikes, ranking
from armgap.report.sections.gap import first_picture, gap_map
from armgap.report.sections.model_labels import Data
from armgap.report.sections.motion import free_run, horizons, predictions
from armgap.report.sections.parameters import parameters
from armgap.report.sections.silent import not_shown, ruled_out

__all__ = ["SECTIONS"]

SECTIONS: tuple[Callable[[Data], Section | None], ...] = (
    first_picture,
    evidence,
    predictions,
    gap_map,
    ranking,
    look_alikes,
    parameters,
    not_shown,
    ruled_out,
    horizons,
    free_run,
    data_quality,
    method,
)
"""Every section, in the order of the page; one that has nothing to say returns None."""
