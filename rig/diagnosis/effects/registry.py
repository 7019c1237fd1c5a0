"""All causes by the key of each: what is registered is simulated, searched for, named and explained like any other."""

from rig.diagnosis.effects.bench import BENCH_EFFECTS
from rig.diagnosis.effects.tissue import TISSUE_EFFECTS
from rig.diagnosis.problem import Effect
from rig.registry import Registry

CAUSES = Registry[Effect]("cause", lambda cause: cause.key, (*TISSUE_EFFECTS, *BENCH_EFFECTS), "tissue_rig.causes")
