"""Study of the bias of a serial arm's estimated parameters by feedback, from closed-loop logs with disturbance torques that no log shows.

A disturbance moves the arm, the controller answers, and so the logged torque depends on it: least squares of torque on motion is then biased, and
the estimated standard deviations do not contain this bias (Ljung 1999, sections 13.4 and 13.5). MuJoCo moves one arm of seven joints under PD control along
multisines and splines, with the generator of `tests.serial_trial`; each run has its own references, disturbance and nominal model. Every log is
made twice, with the disturbance and with the encoders' steps alone, and estimates are compared with the true values in base parameters.

``python -m tests.feedback_study --seed S --runs 50 --json F`` makes runs (`case.py`), estimates (`estimates.py`), prints tables (`report.py`).
"""
