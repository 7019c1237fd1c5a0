"""Causes that are memory of the tissue: it relaxes with one, two or three times, or with times spread over decades.

All are parameters of one operator, which adds up their terms: each sees the force at rest, not what another left of it.
"""

from dataclasses import replace

import numpy as np
from scipy.special import gammainc, gammaincinv

from rig.diagnosis.problem import Effect, Par
from rig.simulation.chain import Operator, Series, Tip, one
from rig.tissue.history import Term
from rig.tissue.index_law import Fields

TERMS = ("relaxation_ratio", "tau_s"), ("second_ratio", "second_tau_s"), ("third_ratio", "third_tau_s")
CELLS = 10  # of a spread; the kernel is then within 1 % of it from a tenth of tau to a hundred of it
TAIL = 1e-3  # of all rates beyond the cells at either end, which the outermost take
SLOWEST = 1e-4  # of the mean rate: what is slower than 10,000 tau stands still while anybody looks
NARROW = 1e-3  # of rates that differ by 3 %, whose kernel is an exponential to 0.1 %


def spread_terms(ratio: float, tau_s: float, spread: float) -> list[Term]:
    """Terms whose sum fades as ratio (1 + spread t/tau)^(-1/spread).

    That is what rates of a gamma distribution leave, of mean 1/tau and relative variance ``spread`` (its Laplace
    transform), here in cells of equal width in the logarithm, each at its mean. Late it is a power of time, as
    fractional viscoelasticity has it (Bonfanti and others 2020, Soft Matter 16:6002).
    """
    if spread < NARROW:
        return [Term(ratio, tau_s)]
    shape = 1 / spread
    low, high = max(gammaincinv(shape, TAIL), SLOWEST * shape), gammaincinv(shape, 1 - TAIL)
    inner = np.geomspace(low, high, CELLS + 1)[1:-1]
    share, moment = (np.diff(gammainc(k, inner), prepend=0.0, append=1.0) for k in (shape, shape + 1))
    rates_per_s = moment / share / tau_s
    return [Term(ratio * part, 1 / rate) for part, rate in zip(share.tolist(), rates_per_s.tolist(), strict=True)]


def _relaxing(tip: Tip, force_N: Series, v: Fields) -> Series:
    terms = [Term(one(v, ratio), one(v, tau)) for ratio, tau in TERMS if v[ratio]]
    if v["relaxation_spread"] and v["relaxation_ratio"]:
        terms[:1] = spread_terms(*terms[0], one(v, "relaxation_spread"))
    return tip.drive.history.respond(np.asarray(force_N, float), terms)


RELAXING = Operator("relaxing", _relaxing)
RELAXATION_RATIO = Par(
    "relaxation_ratio", "1", 0.0, 0.0, 30.0, 0.02, least=0.005, may_end=True, meaning="transient over lasting force"
)
RELAXATION = Effect(
    "relaxation",
    "the tissue relaxes: a transient of {relaxation_ratio:.3g} times the lasting elastic force "
    "dies out in {tau_s:.3g} s",
    (RELAXATION_RATIO,),
    (Par("tau_s", "s", 1.0, 0.005, 100.0, 1.0, log=True, meaning="time constant"),),
    lambda *_: [{"tau_s": tau} for tau in (0.02, 0.06, 0.2, 0.6, 2.0, 6.0, 20.0)],
    begin={"relaxation_ratio": 1.0, "tau_s": 2.0, "b_per_mm": 0.05},
    one_sided=True,
    operator=RELAXING,
    needs=frozenset({"depth"}),
    control="in the inverse model and, as sudden stiffness, in the gains",
    repair="use the model with relaxation; wait out the time constant before reading a static force",
)


def _further(ordinal: str, beside: str) -> Effect:
    return Effect(
        f"{ordinal}_relaxation",
        f"the tissue relaxes with a {ordinal} time: a further transient of {{{ordinal}_ratio:.3g}} times the lasting "
        f"elastic force dies out in {{{ordinal}_tau_s:.3g}} s",
        # As of the first.
        (
            replace(
                RELAXATION_RATIO, name=f"{ordinal}_ratio", may_end=False, meaning="further transient over lasting force"
            ),
        ),
        (Par(f"{ordinal}_tau_s", "s", 1.0, 0.005, 100.0, 1.0, log=True, meaning="its time constant"),),
        lambda *_: [{f"{ordinal}_tau_s": tau} for tau in (0.02, 0.1, 0.5, 2.5, 12.0)],
        one_sided=True,
        beside=beside,
        operator=RELAXING,
        needs=frozenset({"depth"}),
        repair="use a model with as many times; wait out the longest before reading a static force",
    )


SECOND_RELAXATION = _further("second", beside="relaxation")
THIRD_RELAXATION = _further("third", beside="second_relaxation")
POWER_LAW_RELAXATION = Effect(
    "power_law_relaxation",
    "the tissue relaxes with times spread over decades: its transient fades as "
    "(1 + {relaxation_spread:.3g} t/tau)^(-1/{relaxation_spread:.3g})",
    # Rates that differ by less than 45 % are one time constant to anybody who waits it out.
    (
        Par(
            "relaxation_spread", "1", 0.0, 0.0, 20.0, 0.2, least=0.2, meaning="variance of rates over their mean square"
        ),
    ),
    # The first tenth of a spread changes the transient's end only, which few recordings show.
    begin={"relaxation_spread": 2.0},
    one_sided=True,
    beside="relaxation",
    operator=RELAXING,
    needs=frozenset({"depth"}),
    repair="read forces at one time after contact, and state it: there is no time after which the force rests",
)
MEMORY_EFFECTS = (RELAXATION, SECOND_RELAXATION, THIRD_RELAXATION, POWER_LAW_RELAXATION)
