"""What the program refuses, as exceptions."""

import json
from typing import Any, List, NamedTuple, Optional


class Fault(NamedTuple):
    """One fault of an input: where it is, what was expected, what to do."""

    message: str
    severity: str = "error"
    file: Optional[str] = None
    line: Optional[int] = None
    column: Optional[int] = None
    key: Optional[str] = None
    expected: Optional[str] = None
    advice: Optional[str] = None


class Error(Exception):
    """A failure of the program, with its stable code (`fluxform --explain CODE`).

    `faults` name file, line and key of every fault, `result` is what was computed before the
    failure, None if nothing was.
    """

    code: str
    exit_code: int
    meaning: str
    message: str
    faults: List[Fault]
    result: Any

    @property
    def advice(self) -> List[str]:
        """What to do about it, one line a fault that says so."""
        return [fault.advice for fault in self.faults if fault.advice]

    def explain(self) -> str:
        """Causes, cures and an example of this kind of failure."""
        from ._commands import run

        return run(explain=self.code).codes[0].explanation

    def __str__(self):
        return f"[{self.code}] {self.message}"


class UsageError(Error):
    """Arguments that are not understood or do not go together."""


class InputError(Error):
    """A design, shape or table with faults."""


class UnmetError(Error):
    """A result that does not meet the request, or an output that cannot be written."""


class VerificationError(Error):
    """A check that failed, or a damaged bundle."""


_KINDS = {2: UsageError, 3: InputError, 4: UnmetError, 5: VerificationError}


def of_json(text, result, shown):
    """The exception that the native half raises."""
    from ._result import result_of

    found = json.loads(text)["error"]
    error = _KINDS.get(found["exit_code"], Error)(found["message"])
    for name in ("code", "exit_code", "meaning", "message"):
        setattr(error, name, found[name])
    error.faults = [Fault(**fault) for fault in found["faults"]]
    error.result = result_of(result, shown) if result else None
    return error
