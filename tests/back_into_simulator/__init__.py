"""Exported corrections, checked in the simulator that made the logs: serial arms with one hidden effect each are diagnosed and exported, and
MuJoCo simulates the exported files over the windows of the holdout.

``python -m tests.back_into_simulator`` prints, per arm and joint, the RMS error of MuJoCo's predictions and that of the diagnosis.
Windows and their measured starts follow the definition of the gap (docs/notation.md) and are computed from the log in numpy; no function of
armgap makes the predictions.
"""
