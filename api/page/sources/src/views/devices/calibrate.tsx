// Force sensor and axis calibrated: the job asks for each step, and goes on once a person says that it is done.
import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import type { Schema } from "../../api";
import { attempt } from "../../attempt";
import { ended, startInControl, useWork } from "../../jobs";
import { Card } from "../../parts/basics";
import { JobState } from "../../parts/job";
import { Start, whyNotMove } from "../../parts/may";
import { t } from "../../texts";

type Found = Schema["CalibrateResult"];

function Calibrate({ kind, text, params, children }: { kind: string; text: string; params: Record<string, unknown>; children?: ComponentChildren }) {
  const [job, follow] = useWork<Found>(kind);
  const begin = (event: Event) => {
    event.preventDefault();
    void attempt(async () => follow((await startInControl<Found>(kind, params)).id));
  };
  return (
    <Card title={t.kinds[kind]!}>
      <p>{text}</p>
      {(!job || ended(job)) && <form onSubmit={begin}>{children}<Start id={kind} why={whyNotMove()}>{t.devices.calibrateStart}</Start></form>}
      <JobState job={job} />
      {job?.result && <p id={`${kind}-done`} class="notice">{t.devices.calibrated(job.result.file)}</p>}
    </Card>
  );
}

export function CalibrateForce() {
  const [weights, name] = useState("");
  const [load, choose] = useState("pressed");
  return (
    <Calibrate kind="calibrate-force" text={t.devices.weightsText} params={{ weights, load }}>
      <label>{t.devices.weights}
        <input id="weights" required maxLength={200} value={weights} onInput={(event) => name(event.currentTarget.value)} />
      </label>
      <label>{t.devices.load}
        <select id="load" value={load} onChange={(event) => choose(event.currentTarget.value)}>
          {Object.entries(t.devices.loads).map(([one, text]) => <option key={one} value={one}>{text}</option>)}
        </select>
      </label>
    </Calibrate>
  );
}

/** Against the tracker; a gauge block asks for numbers that only who stands at the bench knows. */
export const CalibrateAxis = () => <Calibrate kind="calibrate-axis" text={t.devices.axisText} params={{}} />;

export const CalibrateDynamics = () => <Calibrate kind="calibrate-dynamics" text={t.devices.dynamicsText} params={{}} />;
