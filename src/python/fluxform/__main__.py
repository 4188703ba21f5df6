"""The program `fluxform`: `python -m fluxform` and the command that pip installs."""

import os
import sys

from . import _native


def main():
    """Run the program as its arguments say; returns the exit code."""
    # STEP files are read by a Python that has OpenCASCADE: this one, unless another is named.
    if sys.executable:
        os.environ.setdefault("FLUXFORM_PYTHON", sys.executable)
    return _native.program(["fluxform", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
