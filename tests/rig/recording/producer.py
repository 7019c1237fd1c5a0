"""A stand-in for the loop: publishes 5 numbered force samples every ms until it is killed.

``producer.py RING`` only publishes; ``producer.py RING FILE`` also starts a recorder on FILE and supervises it.
"""

import sys
import time
from pathlib import Path

from rig.channels import FORCE, ForceSample
from rig.recording.client import RecorderClient
from rig.recording.ring import RingWriter


def main(ring_path: Path, recording: Path | None) -> None:
    ring = RingWriter.create(ring_path)
    client = RecorderClient(ring_path) if recording else None
    if client and recording:
        client.open(recording, {})
    seq = 0
    sys.stdout.write("running\n")
    sys.stdout.flush()
    while True:
        for _ in range(5):
            ring.put(FORCE.id, FORCE.pack(ForceSample(seq, seq, seq, seq, 0, 0, seq / 7, 0, 0, 0, 20, 0, 1)))
            seq += 1
        time.sleep(0.001)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else None)
