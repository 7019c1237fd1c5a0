// Second step: the force that is never passed, known or found by a slow ramp that the subject stops.
import { useState } from "preact/hooks";
import type { Schema } from "../../api";
import { get } from "../../api";
import { attempt } from "../../attempt";
import { sessionName } from "../../clock";
import { ended, startInControl, useWork } from "../../jobs";
import { rig } from "../../live";
import { useLoaded, type Loaded } from "../../loaded";
import { Card, Show, shown } from "../../parts/basics";
import { JobState } from "../../parts/job";
import { Start, whyNotMove } from "../../parts/may";
import { ModelChoice, Origin, keyOf, ownModel, refOf, useModels } from "../../parts/models";
import { Now } from "../../parts/now";
import { Glove } from "./glove";
import { pressStop } from "../../stop";
import { link } from "../../route";
import { atMost, keepSubject, siteRules, thresholdAt, type OnBench, type Subject } from "../../subject";
import { t } from "../../texts";

type Found = Schema["Threshold"];

function Known({ on, reload }: { on: OnBench; reload: () => void }) {
  const [force_N, set] = useState(String(on.value.pain_threshold_N));
  const wanted = Number(force_N);
  const keep = async (event: Event) => {
    event.preventDefault();
    await attempt(() => keepSubject(on, { pain_threshold_N: wanted }));
    reload();
  };
  const isSet = siteRules(on.value) ? t.run.isSet : t.run.isInForce;
  return (
    <>
      <dl class="facts large">
        <div><dt>{t.run.threshold}</dt><dd><output id="threshold">{shown(thresholdAt(on.value), 1)}</output> <small>N</small></dd></div>
        <div><dt>{t.run.forceLimit}</dt><dd><output id="force-limit">{shown(rig.value?.limits.force_N, 1)}</output> <small>N</small></dd></div>
      </dl>
      {siteRules(on.value) && <SiteRules on={on} reload={reload} />}
      <form onSubmit={keep}>
        <label>{on.value.id ? t.run.thresholdOf(on.value.id) : t.run.thresholdKnown}
          <input id="threshold-known" type="number" required min="0.5" max="50" step="0.1" value={force_N} onInput={(event) => set(event.currentTarget.value)} />
        </label>
        <Start id="threshold-keep" why={wanted === on.value.pain_threshold_N ? isSet : whyNotMove()}>{t.run.keepThreshold}</Start>
        <p class="quiet whole">{t.run.thresholdHint}</p>
      </form>
    </>
  );
}

/** That the site's own threshold is the lower one, and the way to put the subject's in its place. */
function SiteRules({ on, reload }: { on: OnBench; reload: () => void }) {
  const { site, pain_threshold_N, site_thresholds_N } = on.value;
  const [own, at] = [shown(pain_threshold_N, 1), shown(thresholdAt(on.value), 1)];
  const replace = () => attempt(() => keepSubject(on, { site_thresholds_N: { ...site_thresholds_N, [site]: pain_threshold_N } })).then(reload);
  return (
    <div class="notice warn" id="site-rules">
      <p>{t.run.siteRules(site, at, own)}</p>
      <Start id="site-replace" quiet why={whyNotMove()} onClick={() => void replace()}>{t.run.siteReplace(site, at, own)}</Start>
    </div>
  );
}

/** Where nothing is fitted to ``subject`` yet: what to do until then, and the session that waits for it if there is one. */
function NoModel({ subject }: { subject: string }) {
  const newest = useLoaded(async () => (subject ? (await get("/api/v1/sessions", { query: { subject, limit: 1 } })).items[0] : undefined), [subject]);
  const session = newest.value?.session;
  return (
    <div class="notice" id="ramp-first">
      <p>{t.run.rampNeedsModel(subject)}</p>
      <ol>
        <li>{t.run.rampFirst.threshold}</li>
        <li>{session ? t.run.rampFirst.isRun : t.run.rampFirst.run}</li>
        <li>{session ? <>{t.run.rampFirst.fitHere} <a id="ramp-fit" href={link("session", session)}>{session}</a></> : t.run.rampFirst.fit}</li>
      </ol>
    </div>
  );
}

function Ramp({ on, reload }: { on: OnBench; reload: () => void }) {
  const loaded = useModels(on.value.id);
  const models = loaded.value ?? [];
  const [chosen, choose] = useState("");
  const [upTo, setUpTo] = useState(String(atMost(Math.min(thresholdAt(on.value), rig.value?.limits.force_N ?? Infinity))));
  const [job, follow] = useWork<Found>("threshold");
  const own = ownModel(models, on.value.id);
  const model = models.find((one) => keyOf(refOf(one)) === chosen) ?? own;
  const begin = (event: Event) => {
    event.preventDefault();
    // Unasked it goes into the session of the model, whose person it is then taken to be of.
    const theirs = model!.subject === on.value.id && model!.site === on.value.site;
    const params = { model: refOf(model!), up_to_N: Number(upTo), ...(!theirs && { session: sessionName(new Date(), "threshold-") }) };
    void attempt(async () => follow((await startInControl<Found>("threshold", params)).id));
  };
  const running = job && !ended(job);
  if (!loaded.value) return <Show loaded={loaded}>{() => null}</Show>;
  return (
    <>
      <p>{t.run.rampText}</p>
      {!own && <NoModel subject={on.value.id} />}
      {running ? (
        <div class="notice">
          <Now of={["force", "setpoint"]} />
          <button id="ramp-pain" type="button" class="danger" onClick={() => void pressStop("pain")}>{t.run.rampStop}</button>
        </div>
      ) : models.length > 0 && (
        <form onSubmit={begin}>
          <ModelChoice id="ramp-model" label={t.run.rampModel} models={models} chosen={model ? keyOf(refOf(model)) : ""} choose={choose} none={own ? undefined : t.run.rampChoose} />
          <label>{t.run.rampUpTo}
            <input id="ramp-up-to" type="number" required min="0.6" max={rig.value?.limits.force_N ?? 50} step="0.1" value={upTo} onInput={(event) => setUpTo(event.currentTarget.value)} />
          </label>
          {model && model !== own && <div class="whole"><Origin model={model} subject={on.value.id} /></div>}
          <Start id="ramp-start" why={whyNotMove() || (model ? "" : t.run.rampNoChoice)}>{t.run.rampStart}</Start>
        </form>
      )}
      <JobState job={job} />
      {job?.result && <Answer found={job.result} session={job.session ?? ""} on={on} reload={reload} />}
    </>
  );
}

/** Whether the ramp of ``session`` was with the person at the site that is on the bench. */
function useIsOf(session: string, { id, site }: Subject): boolean {
  const loaded = useLoaded(async () => (await get("/api/v1/sessions", { query: { session, limit: 1 } })).items[0] ?? null, [session]);
  return loaded.value?.session === session && loaded.value.subject === id && loaded.value.site === site;
}

function Answer({ found, session, on, reload }: { found: Found; session: string; on: OnBench; reload: () => void }) {
  const isTheirs = useIsOf(session, on.value);
  const { force_N } = found;
  if (force_N === null) return <p class="notice" id="ramp-result">{t.run.rampNone(shown(found.up_to_N, 1))}</p>;
  const limit_N = atMost(force_N);
  const keep = () => attempt(() => keepSubject(on, { pain_threshold_N: limit_N })).then(reload);
  return (
    <div class="notice" id="ramp-result">
      <p>{t.run.rampFound(shown(force_N), session)}</p>
      {isTheirs && limit_N > 0 && limit_N !== on.value.pain_threshold_N && <Start id="ramp-keep" why={whyNotMove()} onClick={() => void keep()}>{t.run.rampKeep(shown(limit_N, 1))}</Start>}
    </div>
  );
}

export function ThresholdStep({ subject }: { subject: Loaded<OnBench> }) {
  return (
    <Card id="step-threshold" title={t.run.step(2, t.run.steps.threshold)}>
      <Show loaded={subject}>
        {(on) => {
          // What was written for one person, site or threshold is not for the next.
          const whom = `${on.value.id}/${on.value.site}/`;
          const force_N = on.value.pain_threshold_N;
          return (
            <>
              <Known key={`${whom}${force_N}`} on={on} reload={subject.reload} />
              <details id="ramp"><summary>{t.run.ramp}</summary><Ramp key={`${whom}${thresholdAt(on.value)}`} on={on} reload={subject.reload} /></details>
              <details id="glove"><summary>{t.run.glove}</summary><Glove key={whom} on={on} reload={subject.reload} /></details>
            </>
          );
        }}
      </Show>
    </Card>
  );
}
