"""Smallest re-positioning of contacting polyhedral parts under size tolerances.

Everything below is loaded when first used: `import fcdm_opt` alone imports no numerical library.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fcdm_opt.curve.batch import DecisionCurves, decision_curves
    from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve
    from fcdm_opt.curve.features import Feature
    from fcdm_opt.curve.segments import Segment, SwitchingPoint
    from fcdm_opt.errors import FcdmError, InputError, UnsolvedError
    from fcdm_opt.geometry.bodies import Body
    from fcdm_opt.geometry.conversion import as_body
    from fcdm_opt.motion import Free, Motion, Rotation, Screw, Translation
    from fcdm_opt.own_motion import OwnMotion
    from fcdm_opt.tolerance.certificate import verify
    from fcdm_opt.tolerance.files import load_problems
    from fcdm_opt.tolerance.keep_out import KeepOut
    from fcdm_opt.tolerance.problem import Problem
    from fcdm_opt.tolerance.ranges.coherent_range import CoherentRange, coherent_range
    from fcdm_opt.tolerance.ranges.contact_times import ContactTimes, contact_times
    from fcdm_opt.tolerance.solution import Certificate, Solution, Status
    from fcdm_opt.tolerance.solver import solve

    __version__: str

__all__ = [
    "Body",
    "Certificate",
    "CoherentRange",
    "ContactTimes",
    "DecisionCurve",
    "DecisionCurves",
    "FcdmError",
    "Feature",
    "Free",
    "InputError",
    "KeepOut",
    "Motion",
    "OwnMotion",
    "Problem",
    "Rotation",
    "Screw",
    "Segment",
    "Solution",
    "Status",
    "SwitchingPoint",
    "Translation",
    "UnsolvedError",
    "__version__",
    "as_body",
    "coherent_range",
    "contact_times",
    "decision_curve",
    "decision_curves",
    "load_problems",
    "solve",
    "verify",
]

_HOME = {
    "Body": "geometry.bodies",
    "Certificate": "tolerance.solution",
    "CoherentRange": "tolerance.ranges.coherent_range",
    "ContactTimes": "tolerance.ranges.contact_times",
    "DecisionCurve": "curve.decision_curve",
    "DecisionCurves": "curve.batch",
    "FcdmError": "errors",
    "Feature": "curve.features",
    "Free": "motion",
    "InputError": "errors",
    "KeepOut": "tolerance.keep_out",
    "Motion": "motion",
    "OwnMotion": "own_motion",
    "Problem": "tolerance.problem",
    "Rotation": "motion",
    "Screw": "motion",
    "Segment": "curve.segments",
    "Solution": "tolerance.solution",
    "Status": "tolerance.solution",
    "SwitchingPoint": "curve.segments",
    "Translation": "motion",
    "UnsolvedError": "errors",
    "as_body": "geometry.conversion",
    "coherent_range": "tolerance.ranges.coherent_range",
    "contact_times": "tolerance.ranges.contact_times",
    "decision_curve": "curve.decision_curve",
    "decision_curves": "curve.batch",
    "load_problems": "tolerance.files",
    "solve": "tolerance.solver",
    "verify": "tolerance.certificate",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        value: Any = version("fcdm_opt")
    elif name in _HOME:
        value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
