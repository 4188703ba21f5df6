"""NLopt and an independent model of the coil; the command is scripts/nlopt_reference.py."""
