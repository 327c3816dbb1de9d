"""Designs for a flexible robot: robot_set, spectrum, sequential."""
import os

from . import _graybox
from ._plan_results import SequentialStudy, SpectrumDesign
from ._progress import Line, finished


def _grid(grid):
    return os.fspath(grid) if isinstance(grid, (str, os.PathLike)) else grid


def _robot(robot):
    return "" if robot is None else os.fspath(robot)


def robot_set(robot=None, grid="paper", *, stiffness=None, threads=1):
    """An InformationSet: one candidate a position of the arm, for its stiffness.

    robot: a graybox-robot/1 file; None: the robot of graybox. grid: "paper" (7920 positions), a
    number of positions, a CSV file, or joint angles in degrees [Q, joints]. stiffness: factors on
    the robot's stiffnesses, for robust() over what they may be.
    """
    return _graybox.robot_set(_robot(robot), _grid(grid), stiffness, threads)


def spectrum(robot=None, grid="paper", *, position_limit=1.0, gap=1e-6, time_limit=None, seed=1,
             threads=1, progress=None):
    """Positions of a robot and the spectrum of the excitation in each, designed at once.

    robot, grid: as for robot_set(). position_limit: the largest share of the time in any position.
    """
    with Line(progress) as show:
        fields = _graybox.spectrum(_robot(robot), _grid(grid), position_limit,
                                   {"gap": gap, "time_limit": time_limit, "seed": seed,
                                    "threads": threads}, show)
    interrupted = fields.pop("interrupted")
    return finished(SpectrumDesign(fields), interrupted)


def sequential(robot=None, grid="paper", *, stages=6, experiments_per_stage=10, repetitions=50,
               start_error=0.4, noise=1e-4, seed=1, threads=1, progress=None):
    """What measuring, estimating and designing again is worth, simulated with many repetitions.

    robot, grid: as for robot_set(); the robot is the truth, and every stiffness of the start is off
    by start_error, up or down. noise: factor on the noise of the robot's file. For the next real
    experiments take exact(H, n, done=counts), H at the present estimate.
    """
    with Line(progress) as show:
        fields = _graybox.sequential(_robot(robot), _grid(grid), noise, {
            "stages": stages, "experiments_per_stage": experiments_per_stage,
            "repetitions": repetitions, "start_error": start_error, "seed": seed,
            "threads": threads}, show)
    return finished(SequentialStudy(fields["data"]), fields["interrupted"])
