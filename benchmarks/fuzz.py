"""``python -m benchmarks.fuzz``: random, mutated and spliced strings into every codec; what is no answer is a crash.

One codec after another, each with strings of its own that depend on ``--seed`` and its name alone. A third of them are
random, the others are real messages, mostly of the codec's own protocol, with bits turned, bytes cut, doubled, or put
between those of another. A codec may return anything, or raise what its caller expects of it; everything else is a
crash, and is printed with the string that makes it, in hexadecimal. What it prints is the table of the documents.
"""

import argparse
import random
import sys
import time
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple

from benchmarks.fuzz_codecs import EXAMPLES, Codec, codecs

LONGEST = 200  # of a random string: twice the longest message but a tool's list
OWN = 0.75  # share of real messages that are of the codec's own protocol, others are told apart from them sooner
MOST_SHOWN = 20  # crashes: those of one bug are alike, and `--only` shows those of one codec


def a_string(rng: random.Random, own: Sequence[bytes] = ()) -> bytes:
    """Random, or an example, ``own`` or anybody's, spoilt in one of a few ways."""
    kind = rng.randrange(6)
    if kind < 2:
        return rng.randbytes(rng.randrange(LONGEST))
    example = bytearray(rng.choice(own if own and rng.random() < OWN else EXAMPLES))
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


def run(each: int, seed: int, tried: Mapping[str, Codec]) -> list[Crash]:
    """``each`` strings into every codec."""
    return [crash for name, codec in tried.items() for crash in run_one(each, seed, name, codec)]


def run_one(count: int, seed: int, name: str, codec: Codec) -> list[Crash]:
    """``count`` strings into one codec, which keeps its state between them as on a line."""
    rng, crashes = random.Random(f"{seed} {name}"), []
    take, may_raise, examples = codec
    for _ in range(count):
        string = a_string(rng, examples)
        try:
            take(string)
        except may_raise:
            continue
        except Exception as error:  # the point of it
            crashes.append(Crash(name, string, f"{type(error).__name__}: {error}"))
    return crashes


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints strings and crashes of each codec; 1 where there was a crash."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--each", type=int, default=10_000, help="strings for each codec; default: 10000")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="*", help="codecs that are called like this, as `zaber*`")
    options = parser.parse_args(arguments)
    tried = {name: codec for name, codec in codecs().items() if fnmatchcase(name, options.only)}
    if not tried:
        parser.error(f"no codec is called like {options.only}; there are {', '.join(codecs())}")
    print("| codec | strings | strings/s | crashes |\n|---|---|---|---|")
    crashes = []
    for name, codec in tried.items():
        crashes += told(options.each, options.seed, name, codec)
    print(f"| {len(tried)} codecs | {options.each * len(tried):,} | | {len(crashes)} |")
    for crash in crashes[:MOST_SHOWN]:
        print(f"{crash.codec}: {crash.error} on {crash.string.hex()}")
    return int(bool(crashes))


def told(count: int, seed: int, name: str, codec: Codec) -> list[Crash]:
    """The codec's line of the table, printed; its crashes."""
    begun = time.monotonic()
    crashes = run_one(count, seed, name, codec)
    rate = count / max(time.monotonic() - begun, 1e-9)
    print(f"| {name} | {count:,} | {rate:,.0f} | {len(crashes)} |", flush=True)
    return crashes


if __name__ == "__main__":
    sys.exit(main())
