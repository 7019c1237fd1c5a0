"""Keys of the stop process: presses become requests, and a device that is gone is shown, looked for, and acted on."""

import selectors
import sys

from controller.stop.keypad import Keys, Pad, open_device
from controller.stop.word import Keypad, Lane, Requester, StopReason, StopWord
from rig.errors import DeviceError

# A plug that was pulled is back in a second or two; a stop acknowledged meanwhile is asked for again as soon.
RETRY_S = 1.0


class Keyboard:
    """The keypad, if there is one: presses become requests; where it goes, it is looked for until it comes back."""

    def __init__(self, page: StopWord, path: str, fd: int, keys: Keys, required: bool) -> None:
        self._page, self._path, self._keys, self._required = page, path, keys, required
        self.requester = Requester(page, Lane.STOP_PROCESS)
        self.presses = 0
        self._pad: Pad | None = Pad(path, fd) if path else None
        self._new = self._pad is not None
        self._retry_at = 0.0
        page.show_keypad(Keypad.OK if path else Keypad.NONE)

    def turn(self, selector: selectors.BaseSelector, now: float) -> None:
        """Registers a new device, and looks for a lost one."""
        if self._path and self._pad is None and now >= self._retry_at:
            self._retry_at = now + RETRY_S
            self._reopen()
        if self._pad and self._new:
            self._new = False
            selector.register(self._pad.fd, selectors.EVENT_READ, lambda: self.read(selector))

    def read(self, selector: selectors.BaseSelector) -> None:
        """Takes the keys pressed."""
        if self._pad is None:
            return
        try:
            for code in self._pad.read():
                self.presses += 1
                self.requester.request(self._keys.kind(code))
        except DeviceError as error:
            selector.unregister(self._pad.fd)
            self._pad.close()
            self._pad = None
            sys.stderr.write(f"{error}\n")
            self._lost()

    def _reopen(self) -> None:
        try:
            self._pad = Pad(self._path, open_device(self._path))
        except DeviceError:
            self._lost()
        else:
            self._new = True
            self._page.show_keypad(Keypad.OK)

    def _lost(self) -> None:
        self._page.show_keypad(Keypad.LOST)
        if self._required:
            self.requester.request(StopReason.KEYPAD_LOST)
