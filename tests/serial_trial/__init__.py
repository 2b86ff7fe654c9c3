"""A trial of the diagnosis of serial arms: logs of arms of three to seven joints from an independent physics engine, with one hidden effect each.

MuJoCo simulates the arms; effects, drives, encoders and controllers are written here from textbooks. The trial shares with armgap only
the interface that a user has: an `armgap.Arm`, logs, and `armgap.diagnose`.

``python -m tests.serial_trial --seed S --cases N --nulls M`` makes the cases of a seed (`case.py`) from arms (`arms.py`), motions (`motion.py`)
and effects (`effects/`), diagnoses them and prints how often the answers are right (`run.py`).
"""
