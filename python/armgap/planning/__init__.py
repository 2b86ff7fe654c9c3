"""Planning of the next experiment: the motion that best settles the questions a diagnosis left open, within an arm's limits.

===========  ==================================================================================
file         what
===========  ==================================================================================
`limits`     limits of the motion, from the arm file or from the range of the logs
`motion`     reference motions from design variables between 0 and 1, all within the limits
`dynamics`   torques that a motion needs, with effects on request
`sizes`      values that an effect could have
`questions`  questions that a diagnosis left open
`criterion`  expected evidence of a motion for one model against another
`outcome`    expected evidence against the thresholds of a diagnosis
`columns`    linear least squares of the criterion
`search`     the motion with the most evidence for all questions
`planning`   `plan` and its result
`page`       the report and the terminal's summary
===========  ==================================================================================
"""

from armgap.planning.planning import Plan, PlannedQuestion, plan

__all__ = ["Plan", "PlannedQuestion", "plan"]
