"""Machines: diagnose, fit, predict, simulate, and a first model."""
import os

from . import _graybox
from ._progress import Line, finished
from ._recordings import files
from ._results import Fit, MachineModel, Prediction, Simulation, Verdict


def _paths(value):
    """A path or a list of them, as texts."""
    if value is None:
        return []
    if isinstance(value, (str, os.PathLike)):
        value = [value]
    return [os.fspath(each) for each in value]


def _path(value):
    return "" if value is None else os.fspath(value)


def diagnose(model, recordings, *, report=None, method="auto", without=(), laws=(), places=(),
             level=0.05, effects=None, ignore_faults=False, time_limit=None, seed=1, threads=1,
             progress=None):
    """Which physics the model lacks: where, what, and how sure.

    model: a file, or a dict with its entries. recordings: a campaign's file or folder, a Recording
    or a list of them. report: a folder for report.html, verdict.json and the extended model;
    without it nothing is written. The others are those of `graybox diagnose`.
    """
    with files() as made, Line(progress) as show:
        fields = _graybox.diagnose({
            "model": made.model(model), "campaign": made.campaign(recordings),
            "report": _path(report), "method": method, "without": list(without),
            "laws": _paths(laws), "places": _paths(places), "level": level, "effects": effects,
            "ignore_faults": ignore_faults, "time_limit": time_limit, "seed": seed,
            "threads": threads}, show)
        verdict = Verdict(made.shown(fields["verdict"]), fields["figures"], fields["model"])
    return finished(verdict, fields["interrupted"])


def fit(model, recordings, *, write=None, physics=(), starts=8, all_starts=False, lines="none",
        refine=(), decimate=1, equal_noise=False, initial_state="free", seed=1, threads=1,
        progress=None):
    """The parameters of a model, with standard errors.

    model, recordings: as for diagnose(). write: a file for the model with the fitted values.
    """
    with files() as made, Line(progress) as show:
        fields = _graybox.fit({
            "model": made.model(model), "campaign": made.campaign(recordings),
            "write": _path(write), "physics": _paths(physics), "starts": starts,
            "all_starts": all_starts, "lines": lines, "refine": list(refine), "decimate": decimate,
            "equal_noise": equal_noise, "initial_state": initial_state, "seed": seed,
            "threads": threads}, show)
        fitted = Fit(made.shown(fields["fit"]), made.shown(fields["text"]))
    return finished(fitted, fields["interrupted"])


def predict(model, recordings, *, physics=(), initial_state="measured", threads=1):
    """How well the model predicts the recordings as it stands: nothing is fitted.

    initial_state of free runs: measured, or free (estimated from the whole recording).
    """
    with files() as made:
        fields = _graybox.predict(made.model(model), made.campaign(recordings), _paths(physics),
                                  threads, initial_state)
        return Prediction(made.shown(fields["prediction"]), made.shown(fields["curves"]))


def simulate(model, plan, folder, *, hidden=None, seed=1, threads=1, progress=None):
    """Carries out a plan by simulation and writes a campaign into the folder.

    model, plan, hidden (physics that the model lacks): files, or dicts with their entries. Ctrl-C
    keeps the recordings that are done; the same call goes on where it was.
    """
    with files() as made, Line(progress) as show:
        fields = _graybox.simulate({
            "model": made.model(model), "plan": made.model(plan, "plan.yaml"),
            "hidden": "" if hidden is None else made.model(hidden, "hidden.yaml"),
            "folder": os.fspath(folder), "seed": seed, "threads": threads}, show)
    interrupted = fields.pop("interrupted")
    return finished(Simulation(fields), interrupted)


def model(*files_of_machine, folder=".", columns=(), sample_time=None, counts_per_turn=None,
          gain=None, base="", tip="", masses=None, motion="open", overwrite=False):
    """A first model.yaml and campaign.yaml from logs, for a robot with its URDF among the files.

    masses: 1 or 2, without a URDF. columns: "NAME=QUANTITY[:UNIT][@JOINT]" where a title does not
    say it. Every guess is in the answer with its reason. Where something can't be known, `questions`
    holds it, and the line in the files waits for the answer.
    """
    names = _paths(files_of_machine)
    urdf = [each for each in names if each.lower().endswith((".urdf", ".urdf.xml"))][:1]
    logs = [each for each in names if each not in urdf]
    if not logs:
        raise _graybox.InputError("model: give a log" + (" beside the URDF" if urdf else ""))
    return MachineModel(_graybox.propose({
        "urdf": urdf[0] if urdf else "", "logs": logs, "folder": os.fspath(folder),
        "columns": list(columns), "sample_time": sample_time, "counts_per_turn": counts_per_turn,
        "gain": gain, "base": base, "tip": tip, "motion": motion, "overwrite": overwrite,
        "masses": "open" if masses is None else str(masses)}))
