// A force that is held or follows a reference, with gains from a tissue's own model.
import { useState } from "preact/hooks";
import { attempt } from "../attempt";
import { ended, startInControl, useWork } from "../jobs";
import { rig } from "../live";
import { Card, Show } from "../parts/basics";
import { JobState } from "../parts/job";
import { Start, whyNotMove } from "../parts/may";
import { ModelChoice, Origin, keyOf, refOf, useModels, type ModelEntry } from "../parts/models";
import { ForceNow, Now } from "../parts/now";
import { TrackedResult, type Tracked } from "../parts/tracked";
import { link } from "../route";
import { useSubject } from "../subject";
import { t } from "../texts";

type What = { forces_N: number[]; seconds: number } | { reference: string };

/** Forces as they were written, or the sentence that says what is wrong with them. */
export function forcesOf(text: string, most_N: number): number[] | string {
  const forces = text.split(/[,;\s]+/).filter(Boolean).map(Number);
  const wrong = forces.find((force) => !(force > 0));
  if (!forces.length || wrong !== undefined) return t.track.noForces;
  const over = forces.find((force) => force > most_N);
  return over === undefined ? forces : t.track.tooMuch(over, most_N);
}

function Wanted({ most_N, begin, why }: { most_N: number; begin: (what: What) => void; why: string }) {
  const [kind, choose] = useState<"forces" | "reference">("forces");
  const [text, write] = useState("1, 2");
  const [seconds, last] = useState("5");
  const [reference, refer] = useState("sine:0.5,mean_N=2");
  const forces = forcesOf(text, most_N);
  const wrong = kind === "forces" && typeof forces === "string" ? forces : "";
  const go = (event: Event) => {
    event.preventDefault();
    begin(kind === "forces" ? { forces_N: forces as number[], seconds: Number(seconds) } : { reference: reference.trim() });
  };
  return (
    <form onSubmit={go} id="track-form">
      <fieldset class="choice whole">
        <legend>{t.track.kind}</legend>
        {(["forces", "reference"] as const).map((one) => (
          <label class="check" key={one}><input type="radio" name="kind" id={`kind-${one}`} checked={kind === one} onChange={() => choose(one)} />{t.track[one]}</label>
        ))}
      </fieldset>
      {kind === "forces" ? (
        <>
          <label>{t.track.forcesN}<input id="forces" required autocomplete="off" value={text} aria-invalid={Boolean(wrong)} onInput={(event) => write(event.currentTarget.value)} /></label>
          <label>{t.track.seconds}<input id="seconds" type="number" required min="1.1" max="600" step="any" value={seconds} onInput={(event) => last(event.currentTarget.value)} /></label>
        </>
      ) : (
        <label class="whole">{t.track.referenceText}<input id="reference" required autocomplete="off" value={reference} onInput={(event) => refer(event.currentTarget.value)} /></label>
      )}
      <Start id="track-start" why={wrong || why}>{t.track.start}</Start>
    </form>
  );
}

function Run({ models, of, subject }: { models: ModelEntry[]; of: string; subject: string }) {
  const [chosen, choose] = useState(keyOf({ session: of, file: "fit" }));
  const [job, follow] = useWork<Tracked>("track");
  const model = models.find((one) => keyOf(refOf(one)) === chosen) ?? models[0]!;
  const running = job && !ended(job);
  const most_N = Math.min(rig.value?.limits.force_N ?? Infinity, model.force_N ?? Infinity);
  const begin = (what: What) => void attempt(async () => follow((await startInControl<Tracked>("track", { model: refOf(model), ...what })).id));
  return (
    <>
      <Card id="track-what" title={t.track.what}>
        <ModelChoice id="track-model" label={t.track.model} models={models} chosen={keyOf(refOf(model))} choose={choose} />
        <Origin model={model} subject={subject} />
        {/* Hidden, not gone: what was written stands for the next run. */}
        <div hidden={Boolean(running)}><Wanted most_N={most_N} begin={begin} why={whyNotMove()} /></div>
        <JobState job={job} />
      </Card>
      <Card id="track-live" title={t.track.live}>
        <Now of={["setpoint", "force", "error"]} />
        <ForceNow />
      </Card>
      {job?.result && (
        <Card id="track-result" title={t.track.result} wide aside={job.session ? <a href={link("session", job.session)}>{t.track.open}</a> : undefined}>
          <TrackedResult found={job.result} />
        </Card>
      )}
    </>
  );
}

export function Track({ of }: { of: string }) {
  const subject = useSubject();
  const id = subject.value?.value.id ?? "";
  const models = useModels(id);
  const none = <><p>{t.track.none}</p><p><a class="button" href={link("run")}>{t.views.run}</a></p></>;
  return (
    <>
      <h1>{t.track.title}</h1>
      <div class="grid pair">
        <Show loaded={models} empty={none}>{(all) => <Run models={all} of={of} subject={id} />}</Show>
      </div>
    </>
  );
}
