"""Tissue models with known parameters, and a session that is one of them."""

from pathlib import Path

import numpy as np

from rig.recording.sessions import SessionInfo, write_session
from rig.tissue.laws import Index
from rig.tissue.model import Model, Provenance, Quality, ValidRange


def index_model(a_N_mm: float, b_per_mm: float, damping_N_s_mm: float, force_N: float = 12.0) -> Model:
    """The index law as if fitted up to ``force_N``."""
    law = Index(a_N_mm=a_N_mm, b_per_mm=b_per_mm, damping_N_s_mm=damping_N_s_mm)
    return Model(
        law=law,
        covariance=np.zeros((3, 3)),
        intervals={name: (value, value) for name, value, *_ in law.parameters},
        interval_level=0.95,
        interval_method="known",
        valid=ValidRange(depth_mm=float(law.depth(force_N)), force_N=force_N, speeds_mm_s=(10.0,)),
        data=Provenance(session="known", trials=("known",), sha256="0" * 64),
        quality=Quality(rmse_N=0.0, max_error_mm=0.0, max_error_percent=0.0),
    )


def known_session(folder: Path) -> None:
    """Writes a session that is the model of an average limb, and has no trial."""
    (folder / "fit").mkdir(parents=True)
    index_model(0.12, 0.22, 0.01, force_N=11.0).save(folder / "fit" / "model.json")
    write_session(folder, SessionInfo(folder.name, "track", "2026-01-01T00:00:00Z", "test"))
