"""One contact of a convex pair: the scale of body 2 that makes it touch body 1 of a given scale.

Both seeds inside their parts, so that there is one answer at most and every contact line bounds it from below:
rho_2 >= (c - a rho_1) / b. `METHODS` are ours and rivals:

own         the walk, the batch, the public curve, the exact path
searches    bisection and Newton steps on rho_2, asking coal or a growth distance
programs    the linear program, by HiGHS and Clarabel
conics      the same program through CasADi
"""

from fcdm_opt_benchmarks.contacts import conics, own, programs, searches
from fcdm_opt_benchmarks.method import Method

METHODS: tuple[Method, ...] = (*own.METHODS, *searches.METHODS, *programs.METHODS, *conics.METHODS)

__all__ = ["METHODS"]
