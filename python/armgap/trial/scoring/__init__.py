"""Scoring of a blind trial's diagnoses against the hidden effects of its cases, per case and over the whole trial."""

from armgap.trial.scoring.case_score import CaseScore, score_case

__all__ = ["CaseScore", "score_case"]
