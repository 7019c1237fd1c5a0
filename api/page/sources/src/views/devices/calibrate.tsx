// Force sensor, gloves and axis calibrated: the job asks for each step, and goes on once a person says that it is done.
import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import type { Schema } from "../../api";
import { attempt } from "../../attempt";
import { ended, startInControl, useWork } from "../../jobs";
import { Card } from "../../parts/basics";
import { useGlove } from "../../parts/gloves";
import { JobState } from "../../parts/job";
import { Start, whyNotMove } from "../../parts/may";
import { t } from "../../texts";

type Found = Schema["CalibrateResult"];

function Calibrate({ kind, text, params, why = "", children }: { kind: string; text: string; params: Record<string, unknown>; why?: string; children?: ComponentChildren }) {
  const [job, follow] = useWork<Found>(kind);
  const begin = (event: Event) => {
    event.preventDefault();
    void attempt(async () => follow((await startInControl<Found>(kind, params)).id));
  };
  return (
    <Card title={t.kinds[kind]!}>
      <p>{text}</p>
      {(!job || ended(job)) && <form onSubmit={begin}>{children}<Start id={kind} why={whyNotMove() || why}>{t.devices.calibrateStart}</Start></form>}
      <JobState job={job} />
      {job?.result && <p id={`${kind}-done`} class="notice">{t.devices.calibrated(job.result.file)}</p>}
    </Card>
  );
}

function Weights({ id, weights, name }: { id: string; weights: string; name: (weights: string) => void }) {
  return (
    <label>{t.devices.weights}
      <input id={id} required maxLength={200} value={weights} onInput={(event) => name(event.currentTarget.value)} />
    </label>
  );
}

export function CalibrateForce() {
  const [weights, name] = useState("");
  const [load, choose] = useState("pressed");
  return (
    <Calibrate kind="calibrate-force" text={t.devices.weightsText} params={{ weights, load }}>
      <Weights id="weights" weights={weights} name={name} />
      <label>{t.devices.load}
        <select id="load" value={load} onChange={(event) => choose(event.currentTarget.value)}>
          {Object.entries(t.devices.loads).map(([one, text]) => <option key={one} value={one}>{text}</option>)}
        </select>
      </label>
    </Calibrate>
  );
}

export function CalibrateGlove() {
  const [weights, name] = useState("");
  const glove = useGlove("calibrate-glove-input");
  return (
    <Calibrate kind="calibrate-glove" text={t.devices.gloveText} params={{ weights, ...glove.asked }} why={glove.why}>
      {glove.choice}
      <Weights id="glove-weights" weights={weights} name={name} />
    </Calibrate>
  );
}

function Millimetres({ id, label, value, set, min, max }: { id: string; label: string; value: string; set: (value: string) => void; min: number; max: number }) {
  return (
    <label>{label}
      <input id={id} type="number" required min={min} max={max} step="any" value={value} onInput={(event) => set(event.currentTarget.value)} />
    </label>
  );
}

/** Against the tracker, or a gauge block, of which only who stands at the bench knows height and place. */
export function CalibrateAxis() {
  const [against, choose] = useState("tracker");
  const [height_mm, setHeight] = useState("");
  const [near_mm, setNear] = useState("");
  const block = against === "block";
  return (
    <Calibrate kind="calibrate-axis" text={t.devices.axisText} params={block ? { gauge_block_mm: Number(height_mm), near_mm: Number(near_mm) } : {}}>
      <label>{t.devices.against}
        <select id="against" value={against} onChange={(event) => choose(event.currentTarget.value)}>
          {Object.entries(t.devices.againsts).map(([one, text]) => <option key={one} value={one}>{text}</option>)}
        </select>
      </label>
      {block && <Millimetres id="block-height" label={t.devices.blockHeight} value={height_mm} set={setHeight} min={1} max={100} />}
      {block && <Millimetres id="block-near" label={t.devices.blockNear} value={near_mm} set={setNear} min={-1000} max={1000} />}
    </Calibrate>
  );
}

export const CalibrateDynamics = () => <Calibrate kind="calibrate-dynamics" text={t.devices.dynamicsText} params={{}} />;
