"""The fault of a sweep that cannot be started: a bad plan, measure or folder."""


class PlanError(Exception):
    """A sweep that cannot be started; the message has one line for each fault, with its remedy."""

    def __init__(self, *faults: str) -> None:
        super().__init__("\n".join(faults))
        self.faults = faults
