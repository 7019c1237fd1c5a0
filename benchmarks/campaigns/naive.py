"""What naive methods name on the sessions of the benchmark: white noise, in-sample, the library's columns as they are.

All work on sums of products (the Gram matrix) of the simulation's own columns and those of every cause.
"""

import numpy as np

from rig.diagnosis.evidence import Tangents, amplitudes_of, information, tangents
from rig.diagnosis.fit import low_noise_view
from rig.diagnosis.noise import Array
from rig.diagnosis.search import Search, testable

STLSQ_SHARE = 0.05
METHODS = ("residual look-up", "in-sample BIC", "STLSQ", "FROLS")


def look_up(t: Tangents) -> set[str]:
    """The one effect whose column looks most like the residual."""
    gradient, hessian = t.gradient.sum(axis=0), t.hessian.sum(axis=0)
    match = [
        max(abs(gradient[c]) / np.sqrt(hessian[c, c] + 1e-300) for c in direction.columns) for direction in t.directions
    ]
    return {t.directions[int(np.argmax(match))].effect.name}


def in_sample_bic(t: Tangents, samples: int) -> set[str]:
    """Every direction that lowers BIC with white noise when it is added alone."""
    chosen: set[str] = set()
    for direction in t.directions:
        _, left = information(t, direction)
        amplitude = amplitudes_of(t, direction)
        if float(amplitude @ left @ amplitude) > len(direction.columns) * np.log(samples):
            chosen.add(direction.effect.name)
    return chosen


def normalised(t: Tangents) -> tuple[Array, Array]:
    """Gram matrix of unit columns (P, P) and their products with the residual (P,)."""
    hessian, gradient = t.hessian.sum(axis=0), t.gradient.sum(axis=0)
    norm = np.sqrt(np.diag(hessian)) + 1e-12
    return hessian / np.outer(norm, norm), gradient / norm


def stlsq(t: Tangents) -> set[str]:
    """Sequentially thresholded least squares on the library's columns (SINDy: Brunton, Proctor, Kutz 2016)."""
    hessian, gradient = normalised(t)
    active = np.ones(len(gradient), bool)
    for _ in range(10):
        solution = np.zeros(len(gradient))
        index = np.flatnonzero(active)
        solution[index] = np.linalg.lstsq(hessian[np.ix_(index, index)], gradient[index], rcond=1e-8)[0]
        active = (np.abs(solution) > STLSQ_SHARE * np.abs(solution).max()) | (np.arange(len(solution)) < t.base)
    return {d.effect.name for d in t.directions if any(active[c] for c in d.columns)}


def frols(t: Tangents, samples: int) -> set[str]:
    """Forward regression by orthogonal least squares (Chen, Billings, Luo 1989), terms counted by BIC.

    Each round takes the column with the largest error reduction after all taken before were projected out.
    """
    gram, match = normalised(t)
    owners = {column: d.effect.name for d in t.directions for column in d.columns}
    chosen = set[str]()
    for column in range(t.base):
        gram, match = projected_out(gram, match, column)
    while True:
        own = np.diag(gram)
        reduction = np.where(own > 1e-8, match**2 / np.maximum(own, 1e-8), 0.0)
        best = int(reduction.argmax())
        if reduction[best] <= np.log(samples):
            return chosen
        chosen.add(owners[best])
        gram, match = projected_out(gram, match, best)


def projected_out(gram: Array, match: Array, column: int) -> tuple[Array, Array]:
    """The same sums with all columns and the residual made orthogonal to ``column``."""
    if gram[column, column] < 1e-8:
        return gram, match
    share = gram[:, column] / gram[column, column]
    return gram - np.outer(share, gram[column]), match - share * match[column]


def naive(search: Search | None) -> dict[str, list[str]]:
    """What each naive method names, by method; the noise is white and as large as from sample to sample."""
    if search is None:
        return {}
    problem = search.before.problem
    t, samples = tangents(low_noise_view(search.before), testable(problem)), len(problem.channels[0].observed)
    found = {
        "residual look-up": look_up(t), "in-sample BIC": in_sample_bic(t, samples), "STLSQ": stlsq(t),
        "FROLS": frols(t, samples),
    }  # fmt: skip
    return {method: sorted(names) for method, names in found.items()}
