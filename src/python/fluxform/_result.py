"""The JSON result of a command as Python's objects."""

import html
import json

import numpy as np


class Result(dict):
    """A result: a dict whose keys are attributes too, lists of numbers being numpy arrays.

    Printed, it is the summary that the program prints.
    """

    text = ""

    def __getattr__(self, name):
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"the result has no {name!r}; it has {', '.join(self)}") from None

    def __dir__(self):
        return [*super().__dir__(), *self]

    def __repr__(self):
        return self.text or super().__repr__()

    def _repr_html_(self):
        return f"<pre>{html.escape(repr(self))}</pre>"


def _converted(value):
    if isinstance(value, dict):
        return Result((key, _converted(entry)) for key, entry in value.items())
    if isinstance(value, list) and value:
        try:
            array = np.asarray(value)
        except ValueError:  # rows of different length
            array = None
        if array is not None and array.dtype.kind in "bif":
            return array
        return [_converted(entry) for entry in value]
    return value


def result_of(content, text, kind=Result):
    """The result that `content` holds as JSON; `text` is its summary."""
    result = kind(_converted(json.loads(content)))
    result.text = text.rstrip()
    return result
