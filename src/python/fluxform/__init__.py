"""Magnetic haptic displays from Python: design, field, force constant, bundle, currents.

    >>> import fluxform
    >>> design = fluxform.Design.load("designs/seed.toml")
    >>> round(float(design.evaluate().coil.resistance_ohm), 2)
    6.08

Every command of the program `fluxform` is here with all of its options (`reach="2cm"` for
`--reach 2cm`), and returns its JSON result: numbers in SI, the unit in the name. Arrays are numpy's.
What the program refuses is raised as `fluxform.Error` with code, place and advice.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from . import expected_error, load_bundle, vector_dual
    from ._bundle import Bundle, Currents
    from ._commands import (
        Design, Lambda, Result, Shape, calibrate, compare, lambda_, optimize, replay, run, verify,
    )
    from ._errors import Error, Fault, InputError, UnmetError, UsageError, VerificationError

# Loaded when first asked for: the program of this package does without numpy.
_HOMES = {
    "_bundle": ("Bundle", "Currents"),
    "_commands": (
        "Design", "Lambda", "Result", "Shape", "calibrate", "compare", "lambda_", "optimize", "replay",
        "run", "verify",
    ),
    "_errors": ("Error", "Fault", "InputError", "UnmetError", "UsageError", "VerificationError"),
}
_MODULES = ("expected_error", "load_bundle", "vector_dual")
__all__ = sorted([*(name for names in _HOMES.values() for name in names), *_MODULES])


def __getattr__(name):
    if name == "__version__":
        from importlib.metadata import version

        return version("fluxform")
    if name in _MODULES:
        return import_module("." + name, __name__)
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module("." + home, __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__():
    return __all__
