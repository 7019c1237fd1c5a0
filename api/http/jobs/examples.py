"""An example of every kind of job, shown in the interface's description and tried by its tests."""

from typing import Any

MODEL = {"session": "first"}
UPLOAD = "0a1b2c3d4e5f"
PARAMS: dict[str, dict[str, object]] = {
    "capture": {"protocol": "indentation", "session": "first"},
    "track": {"model": MODEL, "forces_N": [1.0, 2.0, 5.0], "seconds": 5.0},
    "retract": {},
    "threshold": {"model": MODEL, "up_to_N": 10.0, "rate_N_s": 0.5},
    "threshold-glove": {"session": "first"},
    "doctor": {},
    "fit": {"sessions": ["first"], "laws": ["fung", "qlv"], "known": {}},
    "diagnose": {"session": "first", "simulation": "index"},
    "protocol-check": {"protocol": "diagnosis"},
    "simulate": {"model": MODEL, "reference": "step:5,duration_s=3", "stiffness": 1.5},
    "report": {"session": "first"},
    "export": {"session": "first", "formats": ["csv", "hdf5"]},
    "verify": {"session": "first"},
    "repair": {"session": "first", "recording": "trial_003"},
    "propose": {"upload": UPLOAD},
    "fit-cohort": {"sessions": ["first", "second"], "laws": ["fung"]},
    "diagnose-cohort": {"sessions": ["first", "second"], "simulation": "index"},
    "report-cohort": {"sessions": ["first", "second"]},
    "calibrate-force": {"weights": "100 g,200 g,500 g", "load": "pressed"},
    "calibrate-glove": {"weights": "100 g,200 g,500 g,1 kg"},
    "calibrate-axis": {"from_mm": 2.0, "to_mm": 14.0},
    "calibrate-dynamics": {"from_mm": 2.0},
    "import": {"upload": UPLOAD, "session": "measured", "usual": True},
}
EXAMPLES: Any = {name: {"summary": name, "value": {"kind": name, "params": params}} for name, params in PARAMS.items()}
