"""Why a run cannot be taken in or handed out."""


class UnknownRunError(Exception):
    """There is no run of that id, or no longer."""

    def __init__(self, run_id: str) -> None:
        super().__init__(f"no run {run_id[:64]!r}")


class NoRecordingError(Exception):
    """A run has nothing to hand out, not yet or not at all."""


class RunsUnavailableError(Exception):
    """No run can be taken in now; says when to try again."""

    def __init__(self, reason: str, retry_after: int) -> None:
        super().__init__(f"{reason}; try again in {retry_after} s")
        self.retry_after = retry_after
        """[s]"""
