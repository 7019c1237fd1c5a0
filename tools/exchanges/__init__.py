"""What each extra is for, once and really: bytes over loopback, with the extra and tissue-rig's own dependencies alone.

A module an extra, each with a function ``exchange`` that raises where it does not work.
"""
