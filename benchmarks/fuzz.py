"""``python -m benchmarks.fuzz``: random, mutated and spliced strings into every codec; what is no answer is a crash.

Each string goes to one codec, the codecs in turn. A third of them are random, the others are real messages, half of
the time of the codec's own protocol, with bits turned, bytes cut, doubled, or put between those of another. A codec may
return anything, or raise what its caller expects of it; everything else is a crash, and is printed with the string that
makes it, in hexadecimal.
"""

import argparse
import random
import sys
import time
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from benchmarks.fuzz_codecs import EXAMPLES, Codec, codecs

LONGEST = 200  # of a random string: twice the longest message but a tool's list


def a_string(rng: random.Random, own: Sequence[bytes] = ()) -> bytes:
    """Random, or an example, ``own`` or anybody's, spoilt in one of a few ways."""
    kind = rng.randrange(6)
    if kind < 2:
        return rng.randbytes(rng.randrange(LONGEST))
    example = bytearray(rng.choice(own if own and rng.random() < 0.5 else EXAMPLES))
    at = rng.randrange(len(example))
    if kind == 2:
        for _ in range(rng.randrange(1, 5)):
            example[rng.randrange(len(example))] ^= 1 << rng.randrange(8)
        return bytes(example)
    if kind == 3:
        return bytes(example[at:] if rng.random() < 0.5 else example[:at])
    other = rng.choice(EXAMPLES)
    return bytes(example[:at]) + other + bytes(example[at:]) if kind == 4 else bytes(example) * rng.randrange(2, 5)


class Crash(NamedTuple):
    """What made which codec raise what."""

    codec: str
    string: bytes
    error: str


def run(count: int, seed: int, tried: Mapping[str, Codec]) -> list[Crash]:
    """``count`` strings, dealt out to the codecs in turn."""
    rng = random.Random(seed)
    named = list(tried.items())
    crashes = []
    for number in range(count):
        name, codec = named[number % len(named)]
        string = a_string(rng, codec.examples)
        try:
            codec.take(string)
        except codec.may_raise:
            continue
        except Exception as error:  # the point of it
            crashes.append(Crash(name, string, f"{type(error).__name__}: {error}"))
    return crashes


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints how many strings and crashes there were; 1 where there was a crash."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--count", type=int, default=100_000, help="strings; default: 100000")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    begun = time.monotonic()
    tried = codecs()
    crashes = run(options.count, options.seed, tried)
    for crash in crashes[:20]:
        print(f"{crash.codec}: {crash.error} on {crash.string.hex()}")
    print(
        f"{options.count} strings, {len(tried)} codecs, seed {options.seed}: {len(crashes)} crashes in "
        f"{time.monotonic() - begun:.0f} s"
    )
    return int(bool(crashes))


if __name__ == "__main__":
    sys.exit(main())
