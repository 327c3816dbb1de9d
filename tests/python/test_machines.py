"""diagnose, fit, predict, simulate and model: on files as the command, and on arrays."""
import json
import os
import signal
import tempfile
import threading
import unittest
from pathlib import Path

import numpy as np

import arm_log
import graybox
from sets import DRIVE, SOURCE, command, refusal

MODEL = os.path.join(DRIVE, "motor.yaml")
MOTOR = {
    "format": "graybox-lumped/1", "sample_time": 0.002, "motion": "rotation",
    "masses": {"motor": 0.001},
    "elements": [{"name": "bearing", "location": {"kind": "element", "mass": "motor"},
                  "law": "viscous",
                  "parameters": {"damping": {"value": 0.001, "unit": "N m s/rad"}}}],
    "inputs": [{"name": "torque", "mass": "motor"}],
    "outputs": [{"name": "speed", "mass": "motor", "quantity": "velocity"}]}
ROTOR = os.path.join(SOURCE, "docs/examples/diagnose/rotor.yaml")
PLAN = os.path.join(SOURCE, "docs/examples/diagnose/rotor_short_plan.yaml")


def recordings():
    runs = []
    for number, role in ((1, "estimation"), (2, "validation")):
        time_s, current, speed = np.loadtxt(os.path.join(DRIVE, f"run_{number}.csv"), delimiter=",",
                                            skiprows=1, unpack=True)
        runs.append(graybox.Recording(
            time_s, inputs={"torque": {"values": current, "unit": "A",
                                       "gain": {"value": 0.12, "unit": "N m/A"}}},
            outputs={"speed": (speed, "rpm")}, role=role, hold="zero", name=f"run_{number}"))
    return runs


class InFolder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)


class Diagnose(InFolder):
    def test_files_give_the_verdict_of_the_command(self):
        said = command("diagnose", MODEL, DRIVE)
        verdict = graybox.diagnose(MODEL, DRIVE)
        self.assertEqual(verdict.data, said)
        self.assertEqual(verdict.verdict, "explained")
        self.assertEqual([each["law"] for each in verdict.physics], ["coulomb"])

    def test_arrays_give_the_same_and_leave_nothing(self):
        there = set(os.listdir(tempfile.gettempdir()))
        here = set(os.listdir("."))
        verdict = graybox.diagnose(MOTOR, recordings())
        self.assertEqual(set(os.listdir(".")), here)
        new = set(os.listdir(tempfile.gettempdir())) - there
        ours = [each for each in new if each.startswith("graybox_")]
        # Folders of other tests that run beside this one come and go.
        self.assertFalse([each for each in ours if not each.startswith("graybox_test.")])
        by_files = graybox.diagnose(MODEL, DRIVE)
        self.assertEqual(verdict.physics, by_files.physics)
        self.assertEqual(verdict.fit, by_files.fit)
        self.assertEqual(verdict.campaign, "recordings.yaml")
        self.assertIn("coulomb", verdict.model)

    def test_the_report_is_that_of_the_command(self):
        report = self.folder / "report"
        verdict = graybox.diagnose(MODEL, DRIVE, report=report)
        self.assertTrue((report / "report.html").exists())
        written = json.loads((report / "verdict.json").read_text())
        self.assertEqual(written, verdict.data)
        self.assertEqual({Path(each).stem for each in written["files"] if each.endswith("svg")},
                         set(verdict.figures))
        page = verdict._repr_html_()
        self.assertIn("<svg", page)
        self.assertIn("verdict: explained", page)
        extended = self.folder / "model.yaml"
        extended.write_text(verdict.model)
        after = graybox.predict(extended, DRIVE)
        before = graybox.predict(MODEL, DRIVE)
        self.assertLess(max(row["nrmse"] for row in after.rows),
                        max(row["nrmse"] for row in before.rows))

    def test_time_limit_and_ctrl_c(self):
        short = graybox.diagnose(MODEL, DRIVE, time_limit=0.02)
        self.assertTrue(short.interrupted)
        # Only what was limited was limited.
        self.assertFalse(graybox.diagnose(MODEL, DRIVE).interrupted)
        threading.Timer(0.05, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        with self.assertRaises(graybox.Interrupted) as stopped:
            for _ in range(20):
                graybox.diagnose(MODEL, DRIVE)
        self.assertTrue(stopped.exception.result.interrupted)

    def test_steps_are_shown(self):
        runs, steps = [], []
        while not steps:  # as long as the machine is too fast to have anything to say
            for recording in recordings():
                recording._name = f"recording_{len(runs)}"
                runs.append(recording)
            graybox.diagnose(MOTOR, runs, progress=steps.append, time_limit=20)
            self.assertLess(len(runs), 20)

    def test_refusals(self):
        for model, campaign in ((MODEL, "nowhere"), ("nowhere.yaml", DRIVE), (DRIVE, MODEL)):
            with self.assertRaises(ValueError) as refused:
                graybox.diagnose(model, campaign)
            self.assertEqual(str(refused.exception), refusal("diagnose", model, campaign))
        for keywords in ({"method": "guess"}, {"level": 2}, {"threads": 0}, {"without": ["love"]}):
            with self.assertRaises(ValueError):
                graybox.diagnose(MODEL, DRIVE, **keywords)


class Arrays(InFolder):
    """Wrong recordings are named by signal, and no message by a folder that is gone."""

    def refused(self, change, pattern):
        signals = {"time": np.arange(500) * 0.002, "torque": (np.ones(500), "N m"),
                   "speed": (np.linspace(0, 1, 500), "rad/s")}
        change(signals)
        with self.assertRaisesRegex(graybox.InputError, pattern) as refused:
            recording = graybox.Recording(signals["time"], inputs={"torque": signals["torque"]},
                                          outputs={"speed": signals["speed"]})
            graybox.predict(MOTOR, recording)
        self.assertNotIn(tempfile.gettempdir(), str(refused.exception))
        self.assertNotIn("\n", str(refused.exception))

    def test_wrong_signals(self):
        def unit(signals):
            signals["speed"] = (signals["speed"][0], "furlong")

        def no_unit(signals):
            signals["speed"] = signals["speed"][0]

        def short(signals):
            signals["speed"] = (np.ones(499), "rad/s")

        def text(signals):
            signals["torque"] = (np.array(["a"] * 500), "N m")

        def backwards(signals):
            signals["time"][100:] -= 0.1
        self.refused(unit, "furlong")
        self.refused(no_unit, "speed: no unit")
        self.refused(short, "speed: 499 samples, but 500 times")
        self.refused(text, "torque: .* numbers")
        self.refused(backwards, "time")

    def test_a_models_urdf_is_found_from_here(self):
        arm_log.write(self.folder)
        before = os.getcwd()
        self.addCleanup(os.chdir, before)
        os.chdir(self.folder)
        t, q, dq, ddq = arm_log.motion(20, 4)
        tau = arm_log.torques(q, dq, ddq)
        arm = {"format": "graybox-rigid-robot/1", "urdf": "arm.urdf", "base": "base",
               "tip": "lower", "gravity": [0, 0, -9.81],
               "joints": [{"name": name, "gear_ratio": 1, "rotor_inertia": 0}
                          for name in ("shoulder", "elbow")],
               "channels": {"torque": ["tau_1", "tau_2"], "torque_of": "arm",
                            "position": ["q_1", "q_2"], "position_of": "arm"}}
        recording = graybox.Recording(
            t, inputs={f"tau_{k + 1}": (tau[:, k], "N m") for k in range(2)},
            outputs={f"q_{k + 1}": (q[:, k], "rad") for k in range(2)})
        # The made-up torques are those of the URDF: differentiating is all that is wrong.
        self.assertLess(max(row["nrmse"] for row in graybox.predict(arm, recording).rows), 2)
        os.remove("arm.urdf")
        with self.assertRaisesRegex(graybox.InputError, "arm.urdf"):
            graybox.predict(arm, recording)

    def test_recordings_must_belong_together(self):
        first, second = recordings()
        second._channels[0]["unit"] = "mA"
        with self.assertRaisesRegex(graybox.InputError, "must be the same"):
            graybox.diagnose(MOTOR, [first, second])
        with self.assertRaisesRegex(graybox.InputError, "expected a campaign"):
            graybox.diagnose(MOTOR, [])


class FitAndPredict(InFolder):
    def test_fit_is_that_of_the_command(self):
        said = command("fit", MODEL, DRIVE)
        fitted = graybox.fit(MODEL, DRIVE)
        self.assertEqual(fitted.data, said)
        self.assertTrue(fitted.converged)
        by_arrays = graybox.fit(MOTOR, recordings())
        self.assertEqual(by_arrays.values, fitted.values)
        self.assertIn("motor.inertia", fitted._repr_html_())
        self.assertTrue(all(error > 0 for error in fitted.standard_errors.values()))

    def test_fit_writes_where_it_is_asked(self):
        friction = os.path.join(DRIVE, "friction.yaml")
        file = self.folder / "fitted.yaml"
        graybox.fit(MODEL, DRIVE, physics=friction, write=file)
        self.assertTrue(file.exists())
        with self.assertRaises(graybox.InputError) as refused:
            graybox.fit(MODEL, DRIVE, lines="full")
        self.assertEqual(str(refused.exception), refusal("fit", MODEL, DRIVE, "--lines", "full"))

    def test_prediction_is_that_of_the_command(self):
        said = command("predict", MODEL, DRIVE)
        prediction = graybox.predict(MODEL, DRIVE)
        self.assertEqual(prediction.data, said)
        said = command("predict", MODEL, DRIVE, "--initial-state", "free")
        self.assertEqual(graybox.predict(MODEL, DRIVE, initial_state="free").data, said)
        with self.assertRaisesRegex(graybox.InputError, "measured or free"):
            graybox.predict(MODEL, DRIVE, initial_state="rest")
        by_arrays = graybox.predict(MOTOR, recordings())
        self.assertEqual([row["nrmse"] for row in by_arrays.rows],
                         [row["nrmse"] for row in prediction.rows])
        curve = prediction.curves[0]
        self.assertEqual(len(curve["time"]), len(curve["predicted"]))
        self.assertIn("<svg", prediction._repr_html_())


class SimulateAndModel(InFolder):
    def test_simulation_is_that_of_the_command(self):
        command("simulate", ROTOR, PLAN, "-o", self.folder / "said")
        simulation = graybox.simulate(ROTOR, PLAN, self.folder / "made")
        self.assertTrue(simulation.complete)
        for file in sorted((self.folder / "said").iterdir()):
            if file.suffix != ".h5":
                continue
            self.assertTrue((self.folder / "made" / file.name).exists(), file.name)
        self.assertEqual(graybox.simulate(ROTOR, PLAN, self.folder / "made").already_there,
                         simulation.recordings)
        with self.assertRaisesRegex(graybox.InputError, "another model, plan or seed"):
            graybox.simulate(ROTOR, PLAN, self.folder / "made", seed=2)

    def test_a_model_from_logs(self):
        logs = [os.path.join(DRIVE, f"run_{k}.csv") for k in (1, 2)]
        proposed = graybox.model(*logs, folder=self.folder, masses=1, gain=0.12,
                                 columns=["speed=velocity:rpm"])
        self.assertEqual(proposed.questions, [])
        self.assertIn("speed", repr(proposed))
        self.assertEqual(graybox.diagnose(proposed.model, proposed.campaign).verdict, "explained")
        with self.assertRaisesRegex(graybox.InputError, "is there already"):
            graybox.model(*logs, folder=self.folder, masses=1)
        with self.assertRaisesRegex(graybox.InputError, "give a log"):
            graybox.model("arm.urdf")


if __name__ == "__main__":
    unittest.main()
