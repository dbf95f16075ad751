"""The smallest motion: our solver, and searches that know nothing of how the problem is built.

methods     ours and the rivals, with their settings; what the judge says of an answer
asked       what a problem asks of a motion, as numbers
cases       problems drawn at random, and those of the chart
least       their least amounts, proved; `held` says what holds a motion, `jets` are the numbers
"""

from fcdm_opt_benchmarks.motions.methods import COARSE, FINE, METHODS, NONE, RIVALS, USUAL, answered, judged

__all__ = ["COARSE", "FINE", "METHODS", "NONE", "RIVALS", "USUAL", "answered", "judged"]
