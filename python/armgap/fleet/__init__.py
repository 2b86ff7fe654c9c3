"""Many robots, many logs: the same diagnosis for every entry of a manifest, what drifts, and which arm is the odd one.

===========  ===============================================================================
file         what
===========  ===============================================================================
`manifest`   entries, read and checked
`work`       one entry diagnosed, in a process of its own
`engines`    where entries are diagnosed: processes of this machine, or a Ray cluster
`folder`     the folder of results: one diagnosis per entry, tables, page; what is done stays
`tables`     rows of the tables
`series`     parameters over the visits of all robots: what drifts, which robot is the odd one
`drift`      the tests behind that
`page`       the page over all of them
===========  ===============================================================================
"""

from armgap.fleet.engines import ENGINES
from armgap.fleet.folder import Fleet, run_fleet
from armgap.fleet.manifest import Entry, read_manifest
from armgap.fleet.series import Move, moving

__all__ = ["ENGINES", "Entry", "Fleet", "Move", "moving", "read_manifest", "run_fleet"]
