// Which glove work is done with: asked for only where the bench has several, and then never guessed.
import { useState } from "preact/hooks";
import { rig } from "../live";
import { t } from "../texts";

/** Names of the gloves that are configured. */
const gloves = () => Object.entries(rig.value?.devices ?? {}).filter(([, one]) => one.product === "firmata-glove").map(([name]) => name);

/** What is asked of the job, why it cannot start yet, and what a person chooses by; the last is nothing for one glove. */
export function useGlove(id: string) {
  const [chosen, choose] = useState("");
  const names = gloves();
  const several = names.length > 1;
  const input = several && names.includes(chosen) ? chosen : "";
  const choice = several && (
    <label>{t.gloves.which}
      <select id={id} value={input} onChange={(event) => choose(event.currentTarget.value)}>
        <option value="">{t.gloves.choose}</option>
        {names.map((name) => <option key={name} value={name}>{name}</option>)}
      </select>
    </label>
  );
  return { asked: input ? { input } : {}, why: several && !input ? t.gloves.noChoice : "", choice };
}
