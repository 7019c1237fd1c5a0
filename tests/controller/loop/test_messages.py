"""Numbers of the kinds of messages, of all processes that talk to each other."""

import controller.loop.messages
import mock_devices.control
import rig.channel
import rig.recording.messages
from rig.channel import Message, Reply

MODULES = (rig.channel, controller.loop.messages, rig.recording.messages, mock_devices.control)


def test_each_kind_that_is_sent_has_a_number_of_its_own_and_what_they_share_has_none() -> None:
    """A kind without one would have that of what it is derived from, and be taken for it."""
    kinds = [one for module in MODULES for one in vars(module).values() if isinstance(one, type)]
    sent = {one for one in kinds if issubclass(one, Message)} - {Message, Reply}
    assert len({vars(one)["TYPE"] for one in sent}) == len(sent) == 23
    assert not hasattr(Message, "TYPE") and not hasattr(Reply, "TYPE")
