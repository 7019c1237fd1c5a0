"""What a tissue of any form and memory could reach: a linear predictor, each recording left out of it in turn.

F = z_r + s_r max(0, sum_ij c_ij M_j[I_i(x - x_r)] + viscous), with c >= 0. I are monotone splines of depth (Ramsay
1988), M the identity and first-order high-pass filters. Each recording has a contact x_r, a scale s_r and a zero z_r of
its own, which are projected out of its sums of products; what is left is linear, so that leaving a recording out is to
take its sums away. It knows nothing of the bench: causes that lie there enter as columns.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import nnls

from rig.diagnosis.fit import Fit
from rig.diagnosis.left_out import STIFFNESS_SD, LeftOut, own_deviations, own_steps
from rig.diagnosis.noise import Array
from rig.simulation.drive import MeasuredMotion
from rig.tissue.index_law import extended_force

# Nine quadratic splines follow a force that grows as Fung's to a thousandth; closer near contact, where it bends.
PIECES, CLOSER, DEGREE = 8, 1.5, 2
TABLE = 2001  # depths at which splines are tabled: straight lines between them are 1e-6 off
FILTERS_A_DECADE = 3  # neighbours a factor of 2.2 apart: no relaxation between them is told from their sum
ROOM = 1.05  # contact may move up by a twentieth of the depth before the last spline ends
WEIGHTS = (10.0, 0.3, 0.01, 3e-4)
USUAL = 0.01  # while contacts are looked for
PULL = 0.02  # of the penalty on curvature: what the data say nothing of stays with the parametric fit
ROUNDS = 3  # the last moves contacts by less than a micrometre
# Contact has local minima: places tried again, and how far from the first one, as a share of the depth.
PLACES, ASIDE = 13, 0.15
NUDGE = 1e-4  # of the depth, for the slope over contact


class OwnTerms(NamedTuple):
    """Contact [mm], scale and zero [N] of each recording, shape (recordings,)."""

    contact_mm: Array
    scale: Array
    zero_N: Array


@dataclass(frozen=True)
class Basis:
    """Forces [N] that a tissue can add to, with memory or without, for a motion as deep as ``deepest_mm``."""

    drive: MeasuredMotion
    deepest_mm: float
    remembers: bool = True

    @cached_property
    def table(self) -> tuple[Array, Array]:
        """Depths (TABLE,) and the splines there (TABLE, 9), each rising from 0 to 1."""
        breaks = self.deepest_mm * (np.arange(PIECES + 1) / PIECES) ** CLOSER
        knots = np.concatenate([[0.0] * DEGREE, breaks, [self.deepest_mm] * DEGREE])
        depth = self.deepest_mm * np.linspace(0, 1, TABLE) ** CLOSER
        pieces = BSpline.design_matrix(depth, knots, DEGREE).toarray()
        return depth, np.cumsum(pieces[:, ::-1], axis=1)[:, -2::-1]

    @cached_property
    def times_s(self) -> Array:
        """Time constants of the filters, from two samples to the longest recording; none of a tissue without memory."""
        if not self.remembers:
            return np.empty(0)
        shortest, longest = 2 * self.drive.period_s, float(self.drive.in_recording_s.max())
        count = max(2, round(FILTERS_A_DECADE * np.log10(max(longest / shortest, 1.0))) + 1)
        return np.geomspace(shortest, max(longest, 2 * shortest), count)

    @cached_property
    def fastest_mm_s(self) -> float:
        """Largest speed, the unit of viscous columns."""
        return max(float(np.abs(self.drive.velocity_mm_s).max()), 1e-9)

    @property
    def size(self) -> int:
        """Columns of the tissue."""
        return int(self.table[1].shape[1]) * (1 + len(self.times_s)) + 2

    def depth_mm(self, contact_mm: Array) -> Array:
        """Below each recording's own contact, shape (n,)."""
        return np.asarray(self.drive.position_mm - contact_mm[self.drive.recording])

    def columns(self, contact_mm: Array) -> Array:
        """All forces, shape (n, size): splines, what each filter leaves of them, two viscous ones."""
        depth_mm = self.depth_mm(contact_mm)
        depth, splines = self.table
        shapes = np.column_stack([np.interp(depth_mm, depth, spline) for spline in splines.T])
        passed = [self.drive.history.transient(shapes, tau_s) for tau_s in self.times_s]
        return np.column_stack([shapes, *passed, *self._viscous(depth_mm)])

    def _viscous(self, depth_mm: Array) -> tuple[Array, Array]:
        """Velocity in contact, and times the depth (Hunt and Crossley 1975)."""
        velocity = np.where(depth_mm > 0, self.drive.velocity_mm_s / self.fastest_mm_s, 0.0)
        return velocity, velocity * depth_mm / self.deepest_mm

    def force(self, contact_mm: Array, factors: Array) -> Array:
        """``columns @ factors`` before its lower bound, with each filter applied once, shape (n,)."""
        depth_mm = self.depth_mm(contact_mm)
        depth, splines = self.table
        of_filter = factors[:-2].reshape(-1, splines.shape[1]) @ splines.T
        total = np.interp(depth_mm, depth, of_filter[0])
        for tau_s, curve in zip(self.times_s, of_filter[1:], strict=True):
            if curve[-1] > 0:
                total += self.drive.history.transient(np.interp(depth_mm, depth, curve), tau_s)
        return np.asarray(total + np.column_stack(self._viscous(depth_mm)) @ factors[-2:])


class _Linear(NamedTuple):
    """The predictor about own terms: columns (n, p), the own terms' (n, 3), and what they are to predict (n,)."""

    columns: Array
    own: Array
    target: Array


@dataclass(frozen=True)
class Flexible:
    """A basis, readings, where the parametric model lies in it, and ``causes`` (n, k) [N] of the bench beside it."""

    basis: Basis
    model: Fit
    causes: Array

    @cached_property
    def prior(self) -> Array:
        """Factors of the parametric tissue, without its memory, and of its causes, shape (size + k,)."""
        depth, splines = self.basis.table
        law, _ = nnls(splines, extended_force(depth, self.model.values))
        passed = np.zeros(len(law) * len(self.basis.times_s))
        viscous = max(float(self.model.values["damping_N_s_mm"]), 0.0) * self.basis.fastest_mm_s
        return np.concatenate([law, passed, [viscous, 0.0], np.ones(self.causes.shape[1])])

    @cached_property
    def penalty(self) -> Array:
        """On curvature along depth and on distance from ``prior``, none on causes, shape (size + k, size + k)."""
        splines = self.basis.table[1].shape[1]
        bend = np.diff(np.eye(splines), 2, axis=0)
        tissue = np.kron(np.eye(1 + len(self.basis.times_s)), bend.T @ bend + PULL * np.eye(splines))
        whole = np.zeros((self.basis.size + self.causes.shape[1],) * 2)
        whole[: len(tissue), : len(tissue)] = tissue
        whole[len(tissue) : self.basis.size, len(tissue) : self.basis.size] = PULL * np.eye(2)
        return whole

    @property
    def start(self) -> OwnTerms:
        """Own terms of the parametric model."""
        values, shifts = self.model.values, self.model.whitener.noise.shifts
        contact_mm = values["surface_mm"] + values["contact_offset_mm"] + shifts[:, 1]
        return OwnTerms(contact_mm, np.exp(shifts[:, 0]), values["zero_N"] + shifts[:, 2])

    @cached_property
    def deviations(self) -> Array:
        """Prior standard deviations of contact, scale and zero; the zero is free."""
        _, contact_mm, zero_N = own_deviations(self.model.problem, self.model.values)
        return np.array([contact_mm, STIFFNESS_SD, zero_N])

    def linear(self, own: OwnTerms, factors: Array) -> _Linear:
        """The predictor about ``own``; where ``factors`` give no push, the tissue has no columns."""
        recording, basis = self.basis.drive.recording, self.basis
        tissue, step_mm = factors[: basis.size], NUDGE * basis.deepest_mm
        bare = basis.force(own.contact_mm, tissue)
        pushed = np.where(bare > 0, own.scale[recording], 0.0)
        slope = (basis.force(own.contact_mm + step_mm, tissue) - bare) / step_mm
        columns = np.column_stack([basis.columns(own.contact_mm) * pushed[:, None], self.causes])
        observed = self.model.problem.channels[0].observed
        terms = np.column_stack([slope * pushed, bare * pushed, np.ones_like(bare)])
        return _Linear(columns, terms, observed - own.zero_N[recording])

    def sums(self, linear: _Linear, noise_N: float) -> Array:
        """Sums of products of columns and target by recording, own terms projected out, (recordings, p + 1, p + 1)."""
        rows = np.column_stack([linear.columns, linear.target])
        keep = self.model.whitener.judged[0]
        found = []
        for begin, end in pairwise(self.basis.drive.starts):
            here, own = rows[begin:end][keep[begin:end]], linear.own[begin:end][keep[begin:end]]
            across = own.T @ here
            taken = np.linalg.solve(own.T @ own + np.diag((noise_N / self.deviations) ** 2), across)
            found.append(here.T @ here - across.T @ taken)
        return np.stack(found)

    def factors(self, sums: Array, weight: float) -> Array:
        """Factors >= 0 of least penalised error for sums (p + 1, p + 1)."""
        gram, cross = sums[:-1, :-1], sums[:-1, -1]
        splines = self.basis.table[1].shape[1]
        penalty = weight * max(float(np.diag(gram)[:splines].mean()), 1e-300) * self.penalty
        whole = gram + penalty
        root = np.linalg.cholesky(whole + 1e-9 * np.diag(np.diag(whole) + np.diag(whole).mean()))
        return np.asarray(nnls(root.T, np.linalg.solve(root, cross + penalty @ self.prior), maxiter=50 * len(cross))[0])

    def own_steps(self, linear: _Linear, error: Array, noise_N: float) -> Array:
        """What own terms take off ``error`` (n,): steps of contact, scale and zero, shape (recordings, 3)."""
        keep = self.model.whitener.judged[0]
        return own_steps(linear.own, error, self.basis.drive.recording, keep, noise_N / self.deviations)

    def improved(self, own: OwnTerms, factors: Array, noise_N: float) -> tuple[OwnTerms, Array]:
        """Factors for these own terms, then own terms for these factors."""
        linear = self.linear(own, factors)
        factors = self.factors(self.sums(linear, noise_N).sum(axis=0), USUAL)
        steps = self.own_steps(linear, linear.target - linear.columns @ factors, noise_N)
        contact, scale, zero = np.clip(steps, -self.deviations, self.deviations).T
        return OwnTerms(own.contact_mm + contact, own.scale * np.exp(scale), own.zero_N + zero), factors

    def rescanned(self, own: OwnTerms, factors: Array) -> OwnTerms:
        """Each recording's contact where ``factors`` with a scale and a zero fit best."""
        aside = ASIDE * self.basis.deepest_mm * np.linspace(-1, 1, PLACES)
        fits = [self._fit_at(own.contact_mm + step, factors) for step in aside]
        best = np.argmin([error for error, _, _ in fits], axis=0)
        at = np.arange(len(best))
        scale, zero = (np.stack([fit[k] for fit in fits])[best, at] for k in (1, 2))
        return OwnTerms(own.contact_mm + aside[best], scale, zero)

    def _fit_at(self, contact_mm: Array, factors: Array) -> tuple[Array, Array, Array]:
        """Squared error, scale and zero of each recording for contacts at ``contact_mm``, each (recordings,)."""
        size, keep = self.basis.size, self.model.whitener.judged[0]
        force = np.maximum(self.basis.force(contact_mm, factors[:size]), 0.0)[keep]
        other = (self.model.problem.channels[0].observed - self.causes @ factors[size:])[keep]
        recording = self.basis.drive.recording[keep]
        count = np.maximum(np.bincount(recording, minlength=len(contact_mm)), 1)
        f, y, ff, fy, yy = (
            np.bincount(recording, product, len(contact_mm)) / count
            for product in (force, other, force * force, force * other, other * other)
        )
        scale = np.clip((fy - f * y) / np.maximum(ff - f * f, 1e-300), 1 / 3, 3.0)
        error = yy - y * y - 2 * scale * (fy - f * y) + scale**2 * (ff - f * f)
        return np.asarray(error), np.asarray(scale), np.asarray(y - scale * f)

    def left_out(self) -> LeftOut:
        """Errors on recordings left out; how smooth the tissue is was chosen on the others."""
        noise_N, own, factors = self.model.whitener.noise.colours[0].sd, self.start, self.prior
        for number in range(ROUNDS):
            own, factors = self.improved(own, factors, noise_N)
            own = self.rescanned(own, factors) if number == 0 else own
        linear = self.linear(own, factors)
        sums = self.sums(linear, noise_N)
        without = [[self.factors(rest, weight) for rest in sums.sum(axis=0) - sums] for weight in WEIGHTS]
        errors = np.array([[_square(part, c) for part, c in zip(sums, row, strict=True)] for row in without])
        others = errors.sum(axis=1, keepdims=True) - errors
        chosen = [without[k][i] for i, k in enumerate(others.argmin(axis=0))]
        recording = self.basis.drive.recording
        error = linear.target - np.einsum("np,np->n", linear.columns, np.stack(chosen)[recording])
        error -= np.einsum("nk,nk->n", linear.own, self.own_steps(linear, error, noise_N)[recording])
        return LeftOut(error, self.model.whitener.judged[0], recording)


def _square(sums: Array, factors: Array) -> float:
    """Squared error of ``factors`` (p,) from sums of products of columns and target."""
    with_target = np.append(-factors, 1.0)
    return float(with_target @ sums @ with_target)
