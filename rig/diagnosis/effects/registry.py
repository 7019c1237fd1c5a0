"""All causes by the key of each: what is registered is simulated, searched for, named and explained like any other."""

from rig.diagnosis.effects.bench import BENCH_EFFECTS
from rig.diagnosis.effects.cogging import COGGING
from rig.diagnosis.effects.forms import ELASTIC_FORMS
from rig.diagnosis.effects.memory import MEMORY_EFFECTS
from rig.diagnosis.effects.tissue import TISSUE_EFFECTS
from rig.diagnosis.problem import Effect
from rig.plugins import instance_of
from rig.registry import Registry

LIBRARY = (*TISSUE_EFFECTS, *MEMORY_EFFECTS, *ELASTIC_FORMS, *BENCH_EFFECTS, COGGING)
CAUSES = Registry[Effect]("cause", lambda cause: cause.key, LIBRARY, "tissue_rig.cause", instance_of(Effect))
