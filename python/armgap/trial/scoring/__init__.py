"""Scoring of answers against opened keys, per case and over a trial."""

from armgap.trial.scoring.case_score import CaseScore, score_case

__all__ = ["CaseScore", "score_case"]
