"""What was found goes back into the simulator it came from: serial arms with one hidden effect each are diagnosed and exported, and MuJoCo steps
the exported files over the windows of the holdout.

``python -m tests.back_into_simulator`` prints, per arm and joint, the RMS error of MuJoCo's predictions beside that of the diagnosis.
Windows and their measured starts follow the definition of the gap (docs/notation.md) and are taken from the log in numpy; nothing of the
library predicts.
"""
