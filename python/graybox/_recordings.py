"""Recordings and models from memory, for calls that read files.

The library reads campaigns from files. Arrays go there through a folder of their own, which is
taken away again when the call has ended; numbers are kept to the last bit.
"""
import contextlib
import json
import os
import tempfile
from pathlib import Path

import numpy as np

from ._graybox import InputError

_ROLES = ("estimation", "validation")


def _signal(name, role, value):
    """(values, the channel's entry in the campaign)."""
    entry = {"name": name, "is": role}
    if isinstance(value, dict):
        rest = dict(value)
        values = rest.pop("values", None)
        entry.update(rest)
    else:
        values, entry["unit"] = value if isinstance(value, tuple) and len(value) == 2 else (value, None)
    if entry.get("unit") is None:
        raise InputError(f"{name}: no unit; write (values, \"rad/s\")")
    values = np.asarray(values)
    if values.ndim != 1 or values.dtype.kind not in "fiu":
        raise InputError(f"{name}: shape {values.shape}: expected one axis of numbers")
    return values, entry


class Recording:
    """Signals of one experiment: arrays of equal length with their units.

        Recording(time, inputs={"torque": (tau, "N m")}, outputs={"speed": (omega, "rad/s")})

    time: s; even steps. A signal is (values, unit), or a dict with values, unit and what a channel
    of a campaign may have (gain, range). role: "estimation" or "validation" (kept out of the fit).
    hold: what the inputs do between samples ("zero", "first", "band_limited"). noise: standard
    deviations by channel. preprocess, excitation, segments, load, ...: as in campaign.yaml.
    """

    def __init__(self, time, inputs, outputs, others=None, *, role="estimation", hold=None,
                 noise=None, preprocess=None, sample_time=None, name=None, **experiment):
        if role not in _ROLES:
            raise InputError(f"role: {role} not in {{{','.join(_ROLES)}}}")
        self.time = np.asarray(time, dtype=float)
        signals = [_signal(key, kind, value)
                   for kind, group in (("input", inputs), ("output", outputs), ("other", others or {}))
                   for key, value in group.items()]
        for values, entry in signals:
            if len(values) != len(self.time):
                raise InputError(f"{entry['name']}: {len(values)} samples, but {len(self.time)} times")
        self._columns = [values for values, _ in signals]
        self._channels = [entry for _, entry in signals]
        self._name = name
        self._experiment = {"role": role, **experiment}
        # A time axis in numbers that were added up is even to rounding alone.
        step = (self.time[-1] - self.time[0]) / (len(self.time) - 1) if len(self.time) > 1 else 1.0
        self._campaign = {"sample_time": sample_time or float(f"{step:.9g}")}
        for key, value in (("hold", hold), ("noise", noise), ("preprocess", preprocess)):
            if value is not None:
                self._campaign[key] = value

    def _write(self, folder, number):
        file = f"{self._name or f'recording_{number}'}.npy"
        np.save(Path(folder) / file, np.column_stack([self.time, *self._columns]).astype(float))
        return {"file": file, **self._experiment}


def _write_campaign(recordings, folder):
    first = recordings[0]
    for each in recordings[1:]:
        if each._channels != first._channels or each._campaign != first._campaign:
            raise InputError("recordings: channels, units, sample time and preprocessing of all "
                             "must be the same; diagnose those that differ by themselves")
    channels = [{**entry, "column": str(2 + k)} for k, entry in enumerate(first._channels)]
    campaign = {"format": "graybox-campaign/1", **first._campaign,
                "time": {"column": "1", "unit": "s"}, "channels": channels,
                "experiments": [each._write(folder, k + 1) for k, each in enumerate(recordings)]}
    _write_yaml(Path(folder) / "recordings.yaml", campaign)


def _write_yaml(path, value):
    path.write_text(json.dumps(value, indent=1))  # JSON is YAML


def _absolute(model):
    """The URDF that a model names, from here instead of from where the model is written."""
    urdf = model.get("urdf")
    if not urdf or "${" in os.fspath(urdf):
        return model
    return {**model, "urdf": os.path.abspath(urdf)}


class Files:
    """Files that stand for what a call was given; `shown()` takes their folder out of texts."""

    def __init__(self, stack):
        self._stack = stack
        self._folder = None

    def _place(self):
        if self._folder is None:
            self._folder = self._stack.enter_context(tempfile.TemporaryDirectory(prefix="graybox_"))
        return Path(self._folder)

    def model(self, model, name="model.yaml"):
        """A path, or a dict with the model's entries."""
        if not isinstance(model, dict):
            return os.fspath(model)
        _write_yaml(self._place() / name, _absolute(model))
        return str(self._place() / name)

    def campaign(self, campaign):
        """A path, a Recording or a list of them."""
        recordings = [campaign] if isinstance(campaign, Recording) else campaign
        if not isinstance(recordings, (list, tuple)):
            return os.fspath(campaign)
        if not recordings or not all(isinstance(each, Recording) for each in recordings):
            raise InputError("recordings: expected a campaign's file or folder, a Recording or a "
                             "list of them")
        _write_campaign(recordings, self._place())
        return str(self._place() / "recordings.yaml")

    def shown(self, value):
        if self._folder is None:
            return value
        if isinstance(value, str):
            return value.replace(self._folder + os.sep, "")
        if isinstance(value, list):
            return [self.shown(each) for each in value]
        if isinstance(value, dict):
            return {key: self.shown(each) for key, each in value.items()}
        return value


@contextlib.contextmanager
def files():
    """Files for one call; messages name no folder that is gone when they are read."""
    with contextlib.ExitStack() as stack:
        made = Files(stack)
        try:
            yield made
        except InputError as error:
            raise InputError(made.shown(str(error))) from None
