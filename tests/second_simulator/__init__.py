"""Second simulator of two-link arms, and cases from it: written without code or conventions of armgap or its trial.

The trial's generator (MuJoCo) and armgap share assumptions that real arms do not meet. In this simulator dry friction is a steep hyperbolic
tangent with a width of its own (in the family ``rounding`` another width per joint, or an algebraic function; in ``presliding`` with
bristles as well), and encoders and friction are on either side of the transmission. In the families ``clutter`` and ``clutter-only`` commands
take effect a fraction of a sample late, every log has its own encoder zero, and a current loop, small effects and a coloured random torque act
on the joints. In ``zeros`` and ``zeros-null``, with three training logs, encoder zeros differ by up to some degrees. In ``moves`` the arm goes from
point to point and dwells there (`motions.py`), with coarser encoders and slower sampling; in all others it follows a multisine.

``python -m tests.second_simulator make DIR --seed S --families single=20,clutter=30`` makes cases (`cases.py`), ``python -m
tests.second_simulator ask DIR -o F.jsonl`` asks `armgap.diagnose`, and ``python -m tests.second_simulator score F.jsonl`` prints the tables.
"""
