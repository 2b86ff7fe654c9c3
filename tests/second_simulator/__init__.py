"""A second simulator of two-link arms, and cases from it: written to share no code and no convention with armgap or its trial.

The trial's generator (MuJoCo) and the library agree on much that real arms do otherwise. Here dry friction is a steep hyperbolic tangent of
its own width (in the family ``rounding`` with another on each joint, or an algebraic function; in ``presliding`` with bristles beside it),
encoders and friction sit on either side of the transmission, commands take effect a part of a sample late, every log has its own encoder
zero (in ``zeros`` and ``zeros-null``, with three training logs, off by up to some degrees), a current loop and small effects stand beside the
one that is hidden, and a coloured random torque acts on every joint.

``python -m tests.second_simulator make --seed S --cases N -o DIR`` makes cases (`cases.py`), ``python -m tests.second_simulator ask DIR -o
F.jsonl`` asks `armgap.diagnose`, and ``python -m tests.second_simulator score F.jsonl`` prints the tables.
"""
