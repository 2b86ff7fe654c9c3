"""Scoring answers against opened keys: per case, then over a trial."""

from armgap.trial.scoring.case_score import CaseScore, score_case

__all__ = ["CaseScore", "score_case"]
