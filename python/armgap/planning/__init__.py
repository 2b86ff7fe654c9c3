"""The next experiment: the motion that settles what a diagnosis left open, within an arm's limits.

===========  ==================================================================================
file         what
===========  ==================================================================================
`limits`     what the motion keeps to: the arm file's limits, or what the logs covered
`motion`     reference motions from numbers between 0 and 1, every one of them within the limits
`dynamics`   torques that a motion needs, with effects on request
`sizes`      values that an effect could have
`questions`  what a diagnosis left open
`criterion`  expected evidence of a motion for one model against another
`outcome`    that evidence beside what a decision of a diagnosis needs
`columns`    the least squares in it
`search`     the motion with the most evidence for all questions
`planning`   `plan` and its result
`page`       the report and the terminal's summary
===========  ==================================================================================
"""

from armgap.planning.planning import Plan, PlannedQuestion, plan

__all__ = ["Plan", "PlannedQuestion", "plan"]
