"""How far the answer depends on which logs of an arm are training logs, which are the holdout, and on the horizon."""
