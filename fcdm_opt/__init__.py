"""Smallest re-positioning of contacting polyhedral parts under size tolerances.

Everything below is loaded when first used: `import fcdm_opt` alone imports no numerical library.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fcdm_opt.along.coherent_range import CoherentRange, coherent_range
    from fcdm_opt.along.contact_times import ContactTimes, contact_times
    from fcdm_opt.curve.batch import DecisionCurves, decision_curves
    from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve
    from fcdm_opt.curve.features import Feature
    from fcdm_opt.curve.segments import Segment, SwitchingPoint
    from fcdm_opt.design.compensation.assembly_yield import AssemblyYield, assembly_yield
    from fcdm_opt.design.compensation.compensation_map import CompensationMap, compensation_map
    from fcdm_opt.design.distributions import Measured, Normal, Uniform
    from fcdm_opt.design.fixed_pose.best_pose import BestPose, best_pose
    from fcdm_opt.design.fixed_pose.clearances import Clearances, clearances
    from fcdm_opt.design.study.results import StudyResult
    from fcdm_opt.design.study.running import run_study
    from fcdm_opt.design.study.study import Study
    from fcdm_opt.design.whatif.budget import budget
    from fcdm_opt.design.whatif.compare import compare
    from fcdm_opt.design.whatif.conflicts import conflicts
    from fcdm_opt.design.whatif.drop import drop
    from fcdm_opt.design.whatif.whatif import WhatIf, whatif
    from fcdm_opt.errors import FcdmError, InputError, UnsolvedError
    from fcdm_opt.geometry.bodies import Body
    from fcdm_opt.geometry.conversion import as_body
    from fcdm_opt.judge.certificate import verify
    from fcdm_opt.model.contact_rows import ContactRow, ContactRows, contact_rows
    from fcdm_opt.motion.motions import Free, Motion, Rotation, Screw, Translation
    from fcdm_opt.motion.own_motion import OwnMotion
    from fcdm_opt.problem.files import load_problems
    from fcdm_opt.problem.keep_out import KeepOut
    from fcdm_opt.problem.problem import Problem
    from fcdm_opt.problem.solution import Certificate, Solution, Status
    from fcdm_opt.solver import solve

    __version__: str

__all__ = [
    "AssemblyYield",
    "BestPose",
    "Body",
    "Certificate",
    "Clearances",
    "CoherentRange",
    "CompensationMap",
    "ContactRow",
    "ContactRows",
    "ContactTimes",
    "DecisionCurve",
    "DecisionCurves",
    "FcdmError",
    "Feature",
    "Free",
    "InputError",
    "KeepOut",
    "Measured",
    "Motion",
    "Normal",
    "OwnMotion",
    "Problem",
    "Rotation",
    "Screw",
    "Segment",
    "Solution",
    "Status",
    "Study",
    "StudyResult",
    "SwitchingPoint",
    "Translation",
    "Uniform",
    "UnsolvedError",
    "WhatIf",
    "__version__",
    "as_body",
    "assembly_yield",
    "best_pose",
    "budget",
    "clearances",
    "coherent_range",
    "compare",
    "compensation_map",
    "conflicts",
    "contact_rows",
    "contact_times",
    "decision_curve",
    "decision_curves",
    "drop",
    "load_problems",
    "run_study",
    "solve",
    "verify",
    "whatif",
]

_HOME = {
    "AssemblyYield": "design.compensation.assembly_yield",
    "BestPose": "design.fixed_pose.best_pose",
    "Body": "geometry.bodies",
    "Certificate": "problem.solution",
    "Clearances": "design.fixed_pose.clearances",
    "CoherentRange": "along.coherent_range",
    "CompensationMap": "design.compensation.compensation_map",
    "ContactRow": "model.contact_rows",
    "ContactRows": "model.contact_rows",
    "ContactTimes": "along.contact_times",
    "DecisionCurve": "curve.decision_curve",
    "DecisionCurves": "curve.batch",
    "FcdmError": "errors",
    "Feature": "curve.features",
    "Free": "motion.motions",
    "InputError": "errors",
    "KeepOut": "problem.keep_out",
    "Measured": "design.distributions",
    "Motion": "motion.motions",
    "Normal": "design.distributions",
    "OwnMotion": "motion.own_motion",
    "Problem": "problem.problem",
    "Rotation": "motion.motions",
    "Screw": "motion.motions",
    "Segment": "curve.segments",
    "Solution": "problem.solution",
    "Status": "problem.solution",
    "Study": "design.study.study",
    "StudyResult": "design.study.results",
    "SwitchingPoint": "curve.segments",
    "Translation": "motion.motions",
    "Uniform": "design.distributions",
    "UnsolvedError": "errors",
    "WhatIf": "design.whatif.whatif",
    "as_body": "geometry.conversion",
    "assembly_yield": "design.compensation.assembly_yield",
    "best_pose": "design.fixed_pose.best_pose",
    "budget": "design.whatif.budget",
    "clearances": "design.fixed_pose.clearances",
    "coherent_range": "along.coherent_range",
    "compare": "design.whatif.compare",
    "compensation_map": "design.compensation.compensation_map",
    "conflicts": "design.whatif.conflicts",
    "contact_rows": "model.contact_rows",
    "contact_times": "along.contact_times",
    "decision_curve": "curve.decision_curve",
    "decision_curves": "curve.batch",
    "drop": "design.whatif.drop",
    "load_problems": "problem.files",
    "run_study": "design.study.running",
    "solve": "solver",
    "verify": "judge.certificate",
    "whatif": "design.whatif.whatif",
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
