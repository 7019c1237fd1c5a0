// The force sensor against known weights: the job asks for each, and goes on once a person says that it rests there.
import { useState } from "preact/hooks";
import type { Schema } from "../../api";
import { attempt } from "../../attempt";
import { ended, startInControl, useWork } from "../../jobs";
import { Card } from "../../parts/basics";
import { JobState } from "../../parts/job";
import { Start, whyNotMove } from "../../parts/may";
import { t } from "../../texts";

type Found = Schema["CalibrateResult"];

export function CalibrateForce() {
  const [weights, name] = useState("");
  const [load, choose] = useState("pressed");
  const [job, follow] = useWork<Found>("calibrate-force");
  const begin = (event: Event) => {
    event.preventDefault();
    void attempt(async () => follow((await startInControl<Found>("calibrate-force", { weights, load })).id));
  };
  return (
    <Card title={t.kinds["calibrate-force"]!}>
      <p>{t.devices.weightsText}</p>
      {(!job || ended(job)) && (
        <form onSubmit={begin}>
          <label>{t.devices.weights}
            <input id="weights" required maxLength={200} value={weights} onInput={(event) => name(event.currentTarget.value)} />
          </label>
          <label>{t.devices.load}
            <select id="load" value={load} onChange={(event) => choose(event.currentTarget.value)}>
              {Object.entries(t.devices.loads).map(([kind, text]) => <option key={kind} value={kind}>{text}</option>)}
            </select>
          </label>
          <Start id="calibrate-force" why={whyNotMove()}>{t.devices.calibrateStart}</Start>
        </form>
      )}
      <JobState job={job} />
      {job?.result && <p id="calibrated" class="notice">{t.devices.calibrated(job.result.file)}</p>}
    </Card>
  );
}
