"""What the force law reaches, the worst of five subjects, by the functions that its tests hold to bounds.

python -m benchmarks.control.reached
"""

from itertools import product

from mock_devices.testing.made import law_in_simulation as held
from mock_devices.testing.made.subjects import NAMES

WRONG = 0.5, 1.0, 2.0
LEVELS_N = tuple(map(float, range(1, 11)))


def main() -> None:
    """Prints the column "reached" of docs/explanation/control.md; errors in mN, overshoot in %, settling in s."""
    print("limb 2 Hz:", *(f"{held.moved_mN(force_N):.1f}" for force_N in held.FORCES_N))
    print("breathing:", *(f"{max(held.breathing_mN(name, at) for name in NAMES):.1f}" for at in (0.5, 10.0)))
    for what, factors in (("wrong model", WRONG), ("right model", (1.0,))):
        low = zip(*(held.low_jumps(name, factor) for name, factor in product(NAMES, factors)), strict=True)
        found = [held.jumps(held.law(name), name, LEVELS_N, factor) for name, factor in product(NAMES, factors)]
        for jumps, worst in (("0.3 N", low), ("1 N", zip(*found, strict=True))):
            print(f"jumps of {jumps}, {what}:", *(f"{max(values):.3f}" for values in worst))
    print(f"contact at 0.3 N: {max(held.peak(held.law(name), name) for name in NAMES):.3f}")
    for frequency_Hz in (0.5, 1.0, 2.0, 5.0, 10.0):
        errors = [held.sine_mN(name, frequency_Hz, factor) for name, factor in product(NAMES, WRONG)]
        print(f"sine {frequency_Hz:g} Hz: {max(errors):.1f}")
    for at in (0.5, 10.0):
        print(f"standing, {at:g} N: {max(held.rms_mN(held.law(name), name, at) for name in NAMES):.1f}")


if __name__ == "__main__":
    main()
