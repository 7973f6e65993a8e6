"""Import published trials of one three-axis pad whose samples are labelled: slip or not.

- ``arq``: an experiment of an HDF5 file of "slip_detection_dataset_2021" (github.com/ARQ-CRISP, BSD-3-Clause): 18 uSkin
  taxels in raw counts, times in ms, and a label for each sample, of which 1 and 5 are slips.
- ``papillarray``: a CSV file without header of "Incipient-Slip-Detection-PapillArray" (github.com/RedmondLabUCD): 9
  pillars at 1000 Hz, each with contact, slip, displacement and force. The object slips once every pillar slipped.

Samples become the messages of an external driver, so that everything from the decoder on runs as in a live run.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slipd.devices import external
from slipd.errors import RecordingError, UsageError
from slipd.events import Bytes
from slipd.tools.recordings.imported_run import START_NS, source_of, tare_request, write_run
from slipd.types.arrays import Array

STREAM = "pad"
TARE_NS = 300_000_000
"""Length of the tare at the begin of a trial, in which nothing touches the pad, ns."""

ARQ_TAXELS = 18
ARQ_SLIPS = (1, 5)
"""Labels of a slip, with the arm at rest and in motion; 0 and 4 are none, 2, 3 and 6 other events."""

PILLARS = 9
PILLAR_COLUMNS = 8
"""Columns of each pillar after the time: contact, slip, displacement x y z, force x y z."""

PILLAR_HZ = 1000.0


@dataclass(frozen=True, slots=True, eq=False)
class TaxelTrial:
    """One trial.

    Attributes:
        time_s: Time of each sample since the first, shape (samples,), s.
        values: What each taxel reads, shape (samples, taxels, 3).
        slips: Whether the object slips, shape (samples,).
    """

    time_s: Array
    values: Array
    slips: NDArray[np.bool_]


def read_arq(source: Path, experiment: str) -> TaxelTrial:
    """Read one experiment of a file, such as ``GGCNN2/SpoolSolder/Pose1/Exp1``.

    Raises:
        RecordingError: The file has no such experiment, or cannot be read.
        UsageError: h5py is not installed.
    """
    try:
        import h5py
    except ImportError as error:
        raise UsageError("an HDF5 file needs the package h5py: pip install h5py") from error
    try:
        with h5py.File(source, "r") as file:
            group: Any = file[experiment]
            parts = [
                np.asarray(group[f"tactile_{name}"], dtype=np.float64)
                for name in ("timestamps", "data_raw", "slips_label")
            ]
    except (OSError, KeyError) as error:
        raise RecordingError(f"{source}: no experiment {experiment!r} can be read: {error}") from error
    time_ms, values, labels = parts
    if values.shape != (ARQ_TAXELS, 3, len(time_ms)) or labels.shape != time_ms.shape:
        raise RecordingError(f"{source}: data must have the shape ({ARQ_TAXELS}, 3, samples), got {values.shape}")
    return _checked(source, (time_ms - time_ms[:1]) * 1e-3, values.transpose(2, 0, 1), np.isin(labels, ARQ_SLIPS))


def read_papillarray(source: Path) -> TaxelTrial:
    """Read one trial; the time is that of the row, because the unit of the first column is not documented.

    Raises:
        RecordingError: The file cannot be read as such.
    """
    try:
        table = np.loadtxt(source, delimiter=",", ndmin=2)
    except OSError as error:
        raise RecordingError(f"{source}: cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise RecordingError(f"{source}: must be a table of numbers in CSV: {error}") from error
    columns = 1 + PILLARS * PILLAR_COLUMNS
    if table.shape[1] != columns:
        raise RecordingError(f"{source}: must have {columns} columns, got {table.shape[1]}")
    pillars = table[:, 1:].reshape(-1, PILLARS, PILLAR_COLUMNS)
    slipped = np.maximum.accumulate(pillars[:, :, 1] == 1.0, axis=0)
    return _checked(source, np.arange(len(table)) / PILLAR_HZ, pillars[:, :, 5:], np.all(slipped, axis=1))


def import_arq(source: Path, out: Path, config_text: str, experiment: str) -> None:
    """Import one experiment of a file; see `read_arq` and `import_taxels`."""
    import_taxels(read_arq(source, experiment), out, config_text)


def import_papillarray(source: Path, out: Path, config_text: str) -> None:
    """Import one trial; see `read_papillarray` and `import_taxels`."""
    import_taxels(read_papillarray(source), out, config_text)


def import_taxels(trial: TaxelTrial, out: Path, config_text: str) -> None:
    """Write one trial as the recording of a live run with this config, which tares the pad at its begin.

    Args:
        trial: The trial; nothing touches the pad in its first `TARE_NS`.
        out: Recording to write; an existing one is never overwritten, and a failure leaves no file.
        config_text: Config for the replay, TOML; one external pad with the stream ``pad``.

    Raises:
        ConfigError: The config has faults.
        RecordingError: The config has no such pad.
        SlipdError: ``out`` cannot be written.
    """
    finger, link = source_of(config_text, f"config for {out.name}", "external", [STREAM])
    times_ns = [START_NS + round(1e9 * time_s) for time_s in trial.time_s.tolist()]
    readings = (
        (t_ns, Bytes(link.name, external.encode_reading(STREAM, t_ns, values=values)))
        for t_ns, values in zip(times_ns, trial.values, strict=True)
    )
    write_run(out, config_text, link, times_ns[-1], readings, [tare_request(finger, times_ns[1], TARE_NS)])


def _checked(source: Path, time_s: Array, values: Array, slips: Any) -> TaxelTrial:
    if len(time_s) < 2 or not (np.isfinite(time_s).all() and np.isfinite(values).all()):
        raise RecordingError(f"{source}: must have two samples or more, all of them finite numbers")
    if (np.diff(time_s) < 0.0).any():
        raise RecordingError(f"{source}: the times must not decrease")
    return TaxelTrial(time_s, values, slips)
