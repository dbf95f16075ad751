"""Exact contacts and curves to measure answers against, and how far answers are from them.

References are rational, from `fcdm_opt.curve.exact`; each point of them that is asked for is proved by its own check,
which sees nothing but the vertices. Errors are relative, computed in rationals and rounded once; 0.0 is an answer that
is the reference, correctly rounded. Both seeds must be inside their parts.

exact    the references
errors   errors of answers, and whether they name what touches
faults   batches of curves, segment by segment
"""

from fcdm_opt_benchmarks.references.errors import contact_error, curve_error, touching_right
from fcdm_opt_benchmarks.references.exact import ExactContact, ExactStretches, exact_contact, exact_curve_in_box
from fcdm_opt_benchmarks.references.faults import CurveFault, feature_faults

__all__ = [
    "CurveFault",
    "ExactContact",
    "ExactStretches",
    "contact_error",
    "curve_error",
    "exact_contact",
    "exact_curve_in_box",
    "feature_faults",
    "touching_right",
]
