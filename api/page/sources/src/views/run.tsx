// From a subject to what came of a run, in four steps that can be read without knowing the bench.
import { useState } from "preact/hooks";
import { every } from "../api";
import { rig } from "../live";
import { useLoaded } from "../loaded";
import { whyNotMove } from "../parts/may";
import { keyOf, ownModel, refOf, useModels } from "../parts/models";
import { useSubject } from "../subject";
import { t } from "../texts";
import { choose, chosen } from "./run/chosen";
import { GoStep } from "./run/go";
import { ProtocolStep } from "./run/protocol";
import { SubjectStep } from "./run/subject";
import { ThresholdStep } from "./run/threshold";

export function Run() {
  const subject = useSubject();
  const limit_N = rig.value?.limits.force_N;
  const protocols = useLoaded(() => every("/api/v1/protocols"), [limit_N]);
  const id = subject.value?.value.id ?? "";
  const models = useModels(id).value ?? [];
  const own = ownModel(models, id);
  const [model, chooseModel] = useState<string | null>(null);
  const usable = (protocols.value ?? []).filter((one) => !one.refusal);
  const protocol = protocols.value?.find((one) => one.name === chosen.value)?.name || (usable[0] ?? protocols.value?.[0])?.name || "";
  const [drafted, draft] = useState(false);
  const nobody = subject.value && !(id.trim() && subject.value.value.pain_threshold_N > 0);
  const whose = nobody ? t.run.nobody : drafted ? t.run.drafted : "";
  const refused = protocols.value?.find((one) => one.name === protocol)?.refusal ? t.run.refusedHere : "";
  // That there is none is not said before it is known.
  const refusal = protocols.value ? (protocol ? refused : t.run.none) : protocols.error || whyNotMove() || t.loading;
  const taken = { protocol, choose, model: model ?? (own ? keyOf(refOf(own)) : ""), chooseModel };
  return (
    <>
      <h1>{t.run.title}</h1>
      <div class="steps">
        <SubjectStep subject={subject} draft={draft} />
        <ThresholdStep subject={subject} />
        <ProtocolStep protocols={protocols} models={models} chosen={taken} on={limit_N} />
        <GoStep protocol={protocol} refusal={refusal || whose} />
      </div>
    </>
  );
}
