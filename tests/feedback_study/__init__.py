"""Study of the bias of a serial arm's estimated parameters by feedback, from closed-loop logs with disturbance torques that no log shows.

A disturbance moves the arm and the controller answers, so the logged torque depends on the disturbance. Least squares of torque on motion is then
biased, and its standard deviations do not contain the bias (Ljung 1999, sections 13.4 and 13.5). MuJoCo moves one arm of seven joints under PD
control along multisines and splines, with the generator of `tests.serial_trial`; each run has its own references, disturbance and nominal model.
Every log is made twice, with the disturbance and with the encoders' steps alone, and estimates are compared with the true values in base
parameters.

``python -m tests.feedback_study --seed S --runs 50 --json F`` makes runs (`case.py`), estimates (`estimates.py`), prints tables (`report.py`).
"""
