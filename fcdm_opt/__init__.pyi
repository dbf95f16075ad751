"""The public names, each once, with the module that it is from: `fcdm_opt/__init__.py` loads them when first used."""

from fcdm_opt.along.coherent_range import (
    AssemblyRange as AssemblyRange,
    CoherentRange as CoherentRange,
    coherent_range as coherent_range,
)
from fcdm_opt.along.contact_times import ContactTimes as ContactTimes, contact_times as contact_times
from fcdm_opt.curve.batch import DecisionCurves as DecisionCurves, decision_curves as decision_curves
from fcdm_opt.curve.decision_curve import DecisionCurve as DecisionCurve, decision_curve as decision_curve
from fcdm_opt.curve.features import Feature as Feature
from fcdm_opt.curve.segments import Segment as Segment, SwitchingPoint as SwitchingPoint
from fcdm_opt.design.cases import SolvedCases as SolvedCases, solve_all as solve_all
from fcdm_opt.design.compensation.assembly_yield import AssemblyYield as AssemblyYield, assembly_yield as assembly_yield
from fcdm_opt.design.compensation.compensation_map import (
    CompensationMap as CompensationMap,
    compensation_map as compensation_map,
)
from fcdm_opt.design.distributions import Measured as Measured, Normal as Normal, Uniform as Uniform
from fcdm_opt.design.fixed_pose.best_pose import BestPose as BestPose, best_pose as best_pose
from fcdm_opt.design.fixed_pose.clearances import Clearances as Clearances, clearances as clearances
from fcdm_opt.design.stack.stack_up import StackUp as StackUp, stack_up as stack_up
from fcdm_opt.design.study.results import StudyResult as StudyResult
from fcdm_opt.design.study.running import run_study as run_study
from fcdm_opt.design.study.study import Study as Study
from fcdm_opt.design.whatif.budget import budget as budget
from fcdm_opt.design.whatif.compare import compare as compare
from fcdm_opt.design.whatif.conflicts import conflicts as conflicts
from fcdm_opt.design.whatif.drop import drop as drop
from fcdm_opt.design.whatif.whatif import WhatIf as WhatIf, whatif as whatif
from fcdm_opt.errors import FcdmError as FcdmError, InputError as InputError, UnsolvedError as UnsolvedError
from fcdm_opt.geometry.bodies import Body as Body, as_body as as_body
from fcdm_opt.geometry.primitives import (
    Box as Box,
    Cone as Cone,
    Cylinder as Cylinder,
    Prism as Prism,
    Sphere as Sphere,
    Torus as Torus,
    cut as cut,
    joined as joined,
)
from fcdm_opt.geometry.size import Size as Size
from fcdm_opt.judge.certificate import verify as verify, verify_assembly as verify_assembly
from fcdm_opt.model.contact_rows import (
    ContactRow as ContactRow,
    ContactRows as ContactRows,
    contact_rows as contact_rows,
)
from fcdm_opt.motion.motions import (
    Free as Free,
    Motion as Motion,
    Rotation as Rotation,
    Screw as Screw,
    Translation as Translation,
)
from fcdm_opt.motion.own_motion import OwnMotion as OwnMotion
from fcdm_opt.problem.assembled import AssemblySolution as AssemblySolution
from fcdm_opt.problem.assembly import Assembly as Assembly
from fcdm_opt.problem.assembly_file import load_assemblies as load_assemblies
from fcdm_opt.problem.keep_out import KeepOut as KeepOut
from fcdm_opt.problem.problem import Problem as Problem, load_problems as load_problems
from fcdm_opt.problem.solution import Certificate as Certificate, Solution as Solution, Status as Status
from fcdm_opt.solver import solve as solve, solve_assembly as solve_assembly
from fcdm_opt.version import __version__ as __version__
