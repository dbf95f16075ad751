"""The whole decision curve of a convex pair in a box: our ways to it, and rivals'.

methods     ours, and all of them with their settings
rivals      bisection, distances, linear programs and growth distances that lead to the curve
rays        where rays of the scale plane meet it, by single growth distances
"""

from fcdm_opt_benchmarks.curves.methods import METHODS

__all__ = ["METHODS"]
