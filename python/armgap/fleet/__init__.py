"""Many robots, many logs: a diagnosis for every entry of a manifest, parameters that drift, and arms that differ from the others.

===========  ===============================================================================
file         what
===========  ===============================================================================
`manifest`   entries of a fleet, read from a file and checked
`work`       diagnosis of one entry, in a process of its own
`engines`    where entries are diagnosed: processes of this machine, or a Ray cluster
`folder`     the folder of results: one diagnosis per entry, tables, page; existing results are kept
`tables`     rows of the tables
`series`     parameters over the visits of all robots: drifting parameters, robots that differ
`drift`      statistical test for drift
`outliers`   statistical test for robots that differ from the others
`page`       HTML page of the whole fleet
===========  ===============================================================================
"""

from armgap.fleet.engines import ENGINES
from armgap.fleet.folder import Fleet, run_fleet
from armgap.fleet.manifest import Entry, read_manifest
from armgap.fleet.series import Move, moving

__all__ = ["ENGINES", "Entry", "Fleet", "Move", "moving", "read_manifest", "run_fleet"]
