"""Clients that others wrote, unchanged, against the tracker mock in another process: ndicapi and scikit-surgery."""

import json
import math
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from drivers.ndi.device import NdiTracker
from drivers.ports import open_port
from mock_devices.testing.ndi import remote_tracker
from mock_devices.testing.remote import RemoteMock
from rig.config.products.ndi_polaris import PolarisWiring

pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("clients")]

NDICAPI = """
import json, sys, time
import ndicapy as ndi

kind, endpoint = sys.argv[1:]
host, _, port = endpoint.rpartition(":")
serial = kind == "serial"
probe = ndi.ndiProbe(endpoint) if serial else ndi.NDI_OKAY
device = ndi.ndiOpen(endpoint) if serial else ndi.ndiOpenNetwork(host, int(port))
say = lambda command: ndi.ndiCommand(device, command)
result = {"probe": probe == ndi.NDI_OKAY, "init": say("INIT:"), "version": say("VER:0")}
if serial:
    result["comm"] = say("COMM:50000")
for handle in ("01", "02"):
    say("PINIT:" + handle)
    say("PENA:" + handle + "D")
say("TSTART:")
time.sleep(0.1)
result["bx_status"] = say("BX:0801") and ndi.ndiGetBXPortStatus(device, b"\\x01")
result["bx"] = [ndi.ndiGetBXTransform(device, handle) for handle in (b"\\x01", b"\\x02")]
say("TX:0001")
result["tx"] = [ndi.ndiGetTXTransform(device, handle) for handle in (b"\\x01", b"\\x02")]
frames = []
for _ in range(5):
    time.sleep(0.05)
    say("TX 0001")
    frames.append(ndi.ndiGetTXFrame(device, b"\\x01"))
result["frames"] = frames
say("TSTOP:")
try:
    say("TX:0001")
except OSError as error:
    result["error"] = str(error)
ndi.ndiClose(device) if serial else ndi.ndiCloseNetwork(device)
print(json.dumps(result))
"""

OPTIONS = """
import json, sys
import ndicapy as ndi

kind, endpoint = sys.argv[1:]
host, _, port = endpoint.rpartition(":")
device = ndi.ndiOpen(endpoint) if kind == "serial" else ndi.ndiOpenNetwork(host, int(port))
say = lambda command: ndi.ndiCommand(device, command)
for command in ("INIT:", "PINIT:01", "PENA:01D", "TSTART:"):
    say(command)
poses = []
for options in ("180F", "1009", "1803"):
    try:
        say("BX:" + options)
    except UnicodeDecodeError:
        pass  # it has parsed the reply; only its text form cannot hold the length's byte
    poses.append(ndi.ndiGetBXTransform(device, b"\\x01"))
result = {"poses": poses, "bx_strays": ndi.ndiGetBXNumberOfPassiveStrays(device)}
result["stray"] = list(ndi.ndiGetBXPassiveStray(device, 1))
say("TX:1001")
result["tx_strays"] = ndi.ndiGetTXNumberOfPassiveStrays(device)
result["revision"] = say("APIREV:")
say("SET:Param.Tracking.Frame Frequency=30")
result["parameter"] = say("GET:Param.Tracking.Frame Frequency")
ndi.ndiClose(device) if kind == "serial" else ndi.ndiCloseNetwork(device)
print(json.dumps(result))
"""

SCIKIT_SURGERY = """
import json, sys
from sksurgerynditracker.nditracker import NDITracker

kind, endpoint, *roms = sys.argv[1:]
if kind == "tcp":
    host, _, port = endpoint.rpartition(":")
    wire = {"tracker type": "vega", "ip address": host, "port": int(port)}
else:
    wire = {"tracker type": "polaris", "serial port": endpoint, "ports to probe": 1}
tracker = NDITracker(wire | {"romfiles": roms, "use quaternions": True})
tracker.start_tracking()
frames = [tracker.get_frame() for _ in range(20)]
tracker.stop_tracking()
asked = tracker._capture_string
tracker.close()
poses, quality = frames[-1][3:5]
print(json.dumps({"asked": asked, "poses": [pose.ravel().tolist() for pose in poses], "quality": list(quality)}))
"""
TIP_WIRE = [0.5, -0.5, 0.5, -0.5, 12.25, -34.5, -1000.0]
ARM_WIRE = [1.0, 0.0, 0.0, 0.0, -250.0, 100.0, -1500.0]


@pytest.fixture(params=["serial", "tcp"])
def remote(request: pytest.FixtureRequest) -> Iterator[RemoteMock]:
    with remote_tracker(request.param) as mock:
        yield mock


def client(script: str, mock: RemoteMock, *arguments: str, folder: Path | None = None) -> dict[str, Any]:
    """Runs a client in a process of its own: ndicapi over TCP would wait for ever for a reply that does not come."""
    ((kind, endpoint),) = mock.endpoints.items()
    path = os.pathsep.join([str(folder), os.environ["PATH"]]) if folder else os.environ["PATH"]
    done = subprocess.run(
        [sys.executable, "-c", script, kind, endpoint, *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env=os.environ | {"PATH": path},
    )
    assert done.returncode == 0, done.stderr
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


def pretended_ping(folder: Path) -> Path:
    """Where there is no ping, one that says the loopback is there: scikit-surgery calls it before it connects."""
    if not shutil.which("ping"):
        script = folder / "ping"
        script.write_text("#!/bin/sh\nexit 0\n")
        script.chmod(0o755)
    return folder


def test_ndicapi_tracks_over_both_wires(remote: RemoteMock) -> None:
    result = client(NDICAPI, remote)
    assert result["probe"]
    assert (result["init"], result.get("comm", "OKAY")) == ("OKAY", "OKAY")
    assert "NDI S/N: P9-00001" in result["version"]
    assert result["bx_status"] == 0x31
    assert result["bx"] == result["tx"] == [[*TIP_WIRE, 0.125], [*ARM_WIRE, 0.25]]
    assert result["frames"] == sorted(set(result["frames"]))
    assert result["error"].startswith("POLARIS 0x0c")


@pytest.mark.parametrize(
    ("freeze_tag", "asked"), [("Polaris Vega 024", "BX:0801"), ("Polaris Vega 008", "TX:0801")], ids=["BX", "TX"]
)
def test_scikit_surgery_tracks_over_both_wires(remote: RemoteMock, tmp_path: Path, freeze_tag: str, asked: str) -> None:
    remote.fault("freeze_tag", freeze_tag)
    roms = [tmp_path / name for name in ("tip.rom", "arm.rom")]
    for rom in roms:
        rom.write_bytes(b"NDI\0" + bytes(range(256)))
    result = client(SCIKIT_SURGERY, remote, *map(str, roms), folder=pretended_ping(tmp_path))
    assert result["asked"] == asked
    assert result["poses"] == [TIP_WIRE, ARM_WIRE]
    assert result["quality"] == [0.125, 0.25]


def test_ndicapi_reads_markers_and_strays_by_all_reply_options(remote: RemoteMock) -> None:
    remote.fault("strays", [[1.5, -2.0, 3.25], [10.0, 20.0, -30.0]])
    result = client(OPTIONS, remote)
    assert result["poses"] == [[*TIP_WIRE, 0.125]] * 3
    assert result["bx_strays"] == result["tx_strays"] == 2
    assert result["stray"] == [10.0, 20.0, -30.0]
    assert result["revision"] == "G.003.005"
    assert result["parameter"] == "Param.Tracking.Frame Frequency=30"


def test_scikit_surgery_sees_a_missing_tool(tmp_path: Path) -> None:
    with remote_tracker("serial") as mock:
        mock.fault("missing", [1])
        rom = tmp_path / "any.rom"
        rom.write_bytes(b"NDI\0")
        result = client(SCIKIT_SURGERY, mock, str(rom), str(rom))
    tip, arm = result["poses"]
    assert tip == TIP_WIRE
    assert all(map(math.isnan, arm))


def test_scikit_surgery_tracks_in_each_of_its_sessions_and_our_driver_starts_after_them(tmp_path: Path) -> None:
    """It frees nothing it loads; and one of its sessions is killed while it tracks."""
    with remote_tracker("tcp") as mock:
        roms = [tmp_path / name for name in ("tip.rom", "arm.rom")]
        for rom in roms:
            rom.write_bytes(b"NDI\0" + bytes(range(256)))
        for _ in range(4):
            result = client(SCIKIT_SURGERY, mock, *map(str, roms), folder=pretended_ping(tmp_path))
            assert result["poses"] == [TIP_WIRE, ARM_WIRE]
        killed = SCIKIT_SURGERY.replace("tracker.stop_tracking()", "import os; os._exit(0)")
        with pytest.raises(IndexError):
            client(killed, mock, *map(str, roms), folder=pretended_ping(tmp_path))
        device = NdiTracker(partial(open_port, mock.address), PolarisWiring(port=mock.address))
        device.start()
        seen: set[int] = set()
        deadline = time.monotonic() + 10
        while seen != {0, 1} and time.monotonic() < deadline:
            seen |= {sample.tool for sample in device.poll(time.monotonic_ns()) if sample.valid}
            time.sleep(0.001)
        device.close()
        assert seen == {0, 1}
