"""A trial of the diagnosis of serial arms: logs of arms of three to seven joints from an independent physics engine, with one hidden effect each.

MuJoCo moves the arms; effects are written from the textbooks, drives, encoders and controllers beside them. Nothing is shared with armgap but
the interface that a user has: an `armgap.Arm`, logs, and `armgap.diagnose`.

``python -m tests.serial_trial --seed S --cases N --nulls M`` makes the cases of a seed (`case.py`) from arms (`arms.py`), motions (`motion.py`)
and effects (`effects.py`), asks the diagnosis and prints how it did (`run.py`).
"""
