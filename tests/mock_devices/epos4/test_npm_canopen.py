"""`canopen` 6.2.1 of npm, unchanged, against the drive mock; the project's own Node runs it.

It is fetched into a folder of this run. Its checksum for block transfers, which the mock does not have, wants a
compiler: in its place stands a module that would raise.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hatch_build import NodeFailed, node, npm
from mock_devices.testing.epos4 import remote_drive
from tests.lacking import lacking

pytestmark = [pytest.mark.extra, pytest.mark.bench, pytest.mark.xdist_group("commands")]
PATIENCE_S = 60.0
NO_CHECKSUM = 'exports.crc = () => { throw new Error("no block transfers"); };\n'
# Frames as lines of SLCAN, on a line that does not become the terminal of the process.
SESSION = r"""
const fs = require('fs');
const { DataType, Device, Eds } = require('canopen');
const line = fs.openSync(process.argv[2], fs.constants.O_RDWR | fs.constants.O_NOCTTY);
const device = new Device({ id: 126, eds: new Eds() });
device.eds.addSdoClientParameter(1, 0x601, 0x581);
device.eds.addHeartbeatConsumer(1, 2000);
device.on('message', ({ id, data }) => {
    fs.writeSync(line, `t${id.toString(16).padStart(3, '0')}${data.length}${data.toString('hex')}\r`);
});
let rest = '';
fs.createReadStream(null, { fd: line }).on('data', (piece) => {
    const lines = (rest + piece.toString('latin1')).split(/[\r\x07]/);
    rest = lines.pop();
    for (const one of lines.filter((one) => one.startsWith('t')))
        device.receive({ id: parseInt(one.slice(1, 4), 16), data: Buffer.from(one.slice(5), 'hex') });
});

async function session() {
    const said = { states: [] };
    const at = (index, subIndex, dataType) => ({ deviceId: 1, index, subIndex, dataType, timeout: 10000 });
    const read = (...where) => device.sdo.upload(at(...where));
    const write = (data, ...where) => device.sdo.download({ data, ...at(...where) });
    device.nmt.on('heartbeat', ({ deviceId, state }) => said.states.push([deviceId, state]));
    fs.writeSync(line, 'C\rS8\rO\r');
    device.start();
    said.vendor = await read(0x1018, 1, DataType.UNSIGNED32);
    said.name = await read(0x1008, 0, DataType.VISIBLE_STRING);
    await write(-4711, 0x607a, 0, DataType.INTEGER32);
    said.target = await read(0x607a, 0, DataType.INTEGER32);
    said.refused = await write(1, 0x6041, 0, DataType.UNSIGNED16).catch((error) => error.code);
    said.absent = await read(0x5fff, 0, DataType.UNSIGNED8).catch((error) => error.code);
    await write(20, 0x1017, 0, DataType.UNSIGNED16);
    device.nmt.startNode(1);
    for (let waited = 0; waited < 10000 && !said.states.some(([, state]) => state === 5); waited += 20)
        await new Promise((done) => setTimeout(done, 20));
    return said;
}
session().then((said) => { console.log(JSON.stringify(said)); process.exit(0); });
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The client, and the session beside it."""
    folder = tmp_path_factory.mktemp("npm")
    (folder / "crc").mkdir()
    (folder / "crc/package.json").write_text('{"name": "node-crc", "version": "1.3.2", "main": "index.js"}')
    (folder / "crc/index.js").write_text(NO_CHECKSUM)
    # A relative path would count from the client's own folder.
    wanted = {"dependencies": {"canopen": "6.2.1"}, "overrides": {"node-crc": f"file:{folder / 'crc'}"}}
    (folder / "package.json").write_text(json.dumps(wanted))
    (folder / "session.js").write_text(SESSION)
    try:
        npm(["install", "--ignore-scripts", "--no-audit", "--no-fund"], folder, PATIENCE_S)
    except NodeFailed as error:
        lacking(f"canopen of npm cannot be installed here: {str(error).splitlines()[-1:]}")
    return folder


@pytest.fixture
def said(folder: Path) -> Iterator[dict[str, Any]]:
    """What the session found."""
    with remote_drive() as mock:
        yield json.loads(node(["session.js", mock.address], folder, PATIENCE_S).splitlines()[-1])


def test_npm_canopen_reads_writes_is_refused_and_starts_the_node(said: dict[str, Any]) -> None:
    assert (said["vendor"], said["name"], said["target"]) == (0xFB, "EPOS4", -4711)
    # CiA 301: write to what is read only, no such object; 5 is operational.
    assert (said["refused"], said["absent"], said["states"][-1]) == (0x06010002, 0x06020000, [1, 5])
