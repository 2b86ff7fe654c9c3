"""Other ways to name a cause, answering the same sealed cases; one file each, one line in :data:`PEERS`."""

from __future__ import annotations

from armgap.trial.methods import Method
from armgap.trial.peers.constant import CONSTANT
from armgap.trial.peers.correlation import CORRELATION
from armgap.trial.peers.frols import FROLS
from armgap.trial.peers.stepwise import STEPWISE
from armgap.trial.peers.sysid import SYSID

PEERS: tuple[Method, ...] = (SYSID, STEPWISE, CORRELATION, FROLS, CONSTANT)
