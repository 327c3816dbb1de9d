"""graybox: which experiments to run, and which physics a model of a machine leaves out.

    import graybox

    design = graybox.solve(H, gap=1e-9)            # H: [Q, d, d], or packed [Q, p]
    proof = graybox.certify(H, design.weights)     # by the checker, from the numbers alone
    verdict = graybox.diagnose("motor.yaml", "campaign/")

Answers are plain objects that show themselves in a notebook. Bad input raises InputError, a
ValueError with one line. Ctrl-C raises Interrupted, a KeyboardInterrupt with the best so far as
`result`.
"""
from . import study
from ._candidates import ContinuousDesign, candidates, continuous
from ._designs import certify, certify_exact, exact, load_design, solve, solvers
from ._graybox import InformationSet, InputError
from ._graybox import version as __version__
from ._machines import diagnose, fit, model, predict, simulate
from ._plan_results import (ConcentratedDesign, Plan, RobustDesign, SequentialStudy,
                            SpectrumDesign)
from ._plans import concentrated, plan, precision_curve, robust
from ._progress import Interrupted
from ._recordings import Recording
from ._results import (Certificate, Design, ExactCertificate, ExactDesign, Fit, MachineModel,
                       Prediction, Simulation, Verdict)
from ._robots import robot_set, sequential, spectrum

__all__ = [
    "Certificate", "ConcentratedDesign", "ContinuousDesign", "Design", "ExactCertificate",
    "ExactDesign", "Fit", "InformationSet", "InputError", "Interrupted", "MachineModel", "Plan",
    "Prediction", "Recording", "RobustDesign", "SequentialStudy", "Simulation", "SpectrumDesign",
    "Verdict", "__version__", "candidates", "certify", "certify_exact", "concentrated",
    "continuous", "diagnose", "exact", "fit", "load_design", "model", "plan", "precision_curve",
    "predict", "robot_set", "robust", "sequential", "simulate", "solve", "solvers", "spectrum", "study",
]
