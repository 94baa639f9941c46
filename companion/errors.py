"""What can go wrong in the companion, named for what happened to the caller."""


class CompanionError(Exception):
    """The companion cannot go on; the message is one line for the operator."""


class UsageError(CompanionError):
    """Something the user gave is wrong; the message says what, where and what to do."""
