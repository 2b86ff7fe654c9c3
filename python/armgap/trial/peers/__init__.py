"""Other ways to name a cause, answering the same sealed cases."""

from __future__ import annotations

from armgap.trial.methods import Method

PEERS: tuple[Method, ...] = ()
