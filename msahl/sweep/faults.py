"""Faults of sweeps: a bad plan, measure or folder; a cluster that cannot be used."""


class PlanError(Exception):
    """A sweep that cannot be started; the message has one line for each fault, with its remedy."""

    def __init__(self, *faults: str) -> None:
        super().__init__("\n".join(faults))
        self.faults = faults


class StoreError(Exception):
    """The folder of a sweep that cannot be used or written; the message names the remedy."""


class ClusterError(Exception):
    """The cluster cannot be used, or was lost; the message says why and what to do."""
