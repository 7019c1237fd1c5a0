"""One law of each kind, of the size of a limb under a 6 mm tip."""

from rig.tissue.laws import Constant, Index, Law
from rig.tissue.laws_elastic import Fung, Layer, Power, Quadratic
from rig.tissue.laws_extended import Extended
from rig.tissue.laws_viscous import HuntCrossley, Prony, QuasiLinear, StandardLinear

EXAMPLES: tuple[Law, ...] = (
    Constant(k_N_mm=0.7, damping_N_s_mm=0.01),
    Index(a_N_mm=0.12, b_per_mm=0.22, damping_N_s_mm=0.01),
    Quadratic(a_N_mm=0.2, c_N_mm2=0.05, damping_N_s_mm=0.01),
    Power(a_N_mmn=0.1, exponent=1.9, damping_N_s_mm=0.0),
    Fung(A_N=0.3, b_per_mm=0.35, damping_N_s_mm=0.02),
    Layer(E_MPa=0.1, radius_mm=3.0, thickness_mm=20.0, poisson_ratio=0.45, damping_N_s_mm=0.01),
    HuntCrossley(a_N_mmn=0.1, exponent=1.7, lambda_N_s_mmn1=0.001),
    StandardLinear(k_N_mm=0.5, k1_N_mm=0.2, tau_s=0.4),
    Prony(k_N_mm=0.5, k1_N_mm=0.1, tau1_s=0.05, k2_N_mm=0.2, tau2_s=1.5),
    Extended(
        a_N_mm=0.12,
        b_per_mm=0.15,
        damping_N_s_mm=0.01,
        quadratic_per_mm=0.05,
        substrate_per_mm3=1e-4,
        relaxation_ratio=0.2,
        tau_s=0.5,
        frame_compliance_mm_N=0.03,
    ),
    QuasiLinear(A_N=0.3, b_per_mm=0.3, relaxation_ratio=0.3, tau_s=0.5),
)
