"""A program that runs the bench in a process of its own, to be frozen or killed: settings as JSON on standard input."""

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.faults.scenarios import SCENARIOS, Ended
from controller.supervisor import Supervisor
from rig.config.wiring import Wiring
from rig.errors import RigError


def main() -> int:
    """Says ``ready``, performs, says how it ended; both as one line of JSON."""
    asked: dict[str, Any] = json.loads(sys.stdin.readline())
    with Supervisor(Wiring.model_validate(asked["wiring"]), loop_module=asked["loop_module"]) as rig:
        print(json.dumps("ready"), flush=True)
        try:
            ended = SCENARIOS[asked["scenario"]].perform(rig, Path(asked["folder"]))
        except RigError as error:
            ended = Ended(str(error))
    print(json.dumps(asdict(ended)), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
