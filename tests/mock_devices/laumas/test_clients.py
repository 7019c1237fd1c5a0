"""Modbus clients of others, unchanged, against the simulated transmitter: pymodbus, minimalmodbus and mbpoll."""

import minimalmodbus
import pytest
from pymodbus.client import ModbusSerialClient

from mock_devices.laumas.mock import LaumasMock
from mock_devices.testing.played import played
from mock_devices.wire import PtyWire
from tests.drivers.laumas.test_device import Cell
from tests.mock_devices.polled import mbpoll

pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("clients")]


@pytest.fixture
def mock() -> LaumasMock:
    return LaumasMock(PtyWire(), Cell())


def test_pymodbus_reads_weights_and_is_refused_what_there_is_not(mock: LaumasMock) -> None:
    with played(mock), ModbusSerialClient(mock.endpoints()["serial"], baudrate=115_200, timeout=2) as client:
        answer = client.read_holding_registers(6, count=5, device_id=1)
        weight = client.convert_from_registers(answer.registers[1:3], client.DATATYPE.INT32, word_order="big")
        assert (answer.registers[0], weight) == (0, -25_000)
        assert client.read_holding_registers(0, count=4, device_id=1).registers[3] == 4711
        assert client.read_holding_registers(16, count=1, device_id=1).exception_code == 2
        assert client.read_holding_registers(0, count=33, device_id=1).exception_code == 3
        assert client.write_register(5, 7, device_id=1).exception_code == 1


def test_minimalmodbus_reads_the_same(mock: LaumasMock) -> None:
    with played(mock):
        instrument = minimalmodbus.Instrument(mock.endpoints()["serial"], 1)
        instrument.serial.baudrate, instrument.serial.timeout = 115_200, 2
        try:
            assert instrument.read_long(7, signed=True) == -25_000
            assert instrument.read_register(6) == 0
            with pytest.raises(minimalmodbus.IllegalRequestError):
                instrument.read_register(40)
        finally:
            instrument.serial.close()


def test_mbpoll_reads_the_same_and_is_told_what_is_wrong(mock: LaumasMock) -> None:
    with played(mock):
        line = mock.endpoints()["serial"]
        assert "[7]: \t-25000\n[9]: \t-25000\n" in mbpoll(line, 1, 115_200, "-t", "4:int", "-B", "-r", "7", "-c", "2")
        assert "Illegal data address" in mbpoll(line, 1, 115_200, "-r", "40")
        assert "Illegal function" in mbpoll(line, 1, 115_200, "-r", "5", write=7)
        assert "Connection timed out" in mbpoll(line, 2, 115_200, "-r", "3")
