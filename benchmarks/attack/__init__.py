"""Oracles, scenes and verdicts of `attack_fits.py`; only `asking` knows the package under attack."""
