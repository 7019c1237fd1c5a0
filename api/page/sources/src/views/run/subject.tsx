// First step: whom the session will be of, and the force that is never passed with them.
import { useEffect, useState } from "preact/hooks";
import { attempt } from "../../attempt";
import { date } from "../../clock";
import { useLoaded, type Loaded } from "../../loaded";
import { Card, Show, shown } from "../../parts/basics";
import { Start, whyNotMove } from "../../parts/may";
import { gone, keepSubject, remember, useKnownSubjects, type OnBench, type Subject } from "../../subject";
import { t } from "../../texts";
import { earlier, type Earlier } from "./earlier";

/** What is known of ``id``; an answer on somebody else, or one that is still to come, is none. */
function useEarlier(on: OnBench, id: string, site: string) {
  const loaded = useLoaded(async () => ({ id, site, found: id ? await earlier(on, id, site) : null }), [on, id, site]);
  return loaded.value?.id === id && loaded.value.site === site ? loaded.value.found : undefined;
}

function Threshold({ id, known, value, write }: { id: string; known: Earlier | null | undefined; value: string; write: (text: string) => void }) {
  const from = known && (known.session ? t.run.knownFrom(shown(known.force_N, 1), known.session, date(known.at), known.site) : t.run.knownHere(shown(known.force_N, 1), known.site));
  return (
    <>
      <label>{t.run.thresholdOf(id)}
        <input id="subject-threshold" type="number" required min="0.5" max="50" step="0.1" value={value} onInput={(event) => write(event.currentTarget.value)} aria-describedby="subject-threshold-hint" />
      </label>
      <p id="subject-threshold-hint" class="whole">{from ?? (known === null && t.run.notKnown(id))} {t.run.homes}</p>
    </>
  );
}

/** Takes whether what is written here is not in use yet. */
type Draft = (is: boolean) => void;

/** Why nobody can be put on the bench as it is written; empty if they can. */
const whyNot = (id: string, site: string, threshold: string) =>
  !id ? t.run.noCode : !site ? t.run.noSite : threshold ? whyNotMove() : t.run.noThreshold;

function Gone({ now, reload }: { now: Subject; reload: () => void }) {
  const text = gone(now);
  const agree = () => {
    remember(now);
    reload();
  };
  if (!text) return null;
  return (
    <div class="notice warn whole">
      <p id="subject-gone">{text}</p>
      <button id="subject-right" type="button" onClick={agree}>{t.run.isRight(now.id)}</button>
    </div>
  );
}

function Form({ on, reload, draft }: { on: OnBench; reload: () => void; draft: Draft }) {
  const [code, write] = useState(on.value.id);
  const [place, locate] = useState(on.value.site);
  const [typed, type] = useState<string | null>(null);
  const [id, site] = [code.trim(), place.trim()];
  const found = useEarlier(on, id, site);
  const threshold = typed ?? (found ? String(found.force_N) : "");
  const known = useKnownSubjects().value ?? [];
  const save = async (event: Event) => {
    event.preventDefault();
    await attempt(async () => t.run.subjectKept(id, site, await keepSubject(on, { id, site, pain_threshold_N: Number(threshold) })));
    reload();
  };
  const name = (text: string) => {
    write(text);
    // What was written for one person is not the next one's.
    type(null);
  };
  const sites = [...new Set(known.flatMap((one) => (one.subject === id || !id ? one.sites : [])))];
  const same = id === on.value.id && site === on.value.site;
  useEffect(() => (draft(!same), () => draft(false)), [same]);
  return (
    <form onSubmit={save} id="subject-form">
      <label>{t.run.code}
        <input id="subject-id" list="codes" required maxLength={80} autocomplete="off" value={code} onInput={(event) => name(event.currentTarget.value)} aria-describedby="code-hint" />
      </label>
      <label>{t.run.site}
        <input id="subject-site" list="sites" required maxLength={80} autocomplete="off" value={place} onInput={(event) => locate(event.currentTarget.value)} />
      </label>
      <datalist id="codes">{known.map((one) => <option key={one.subject} value={one.subject} />)}</datalist>
      <datalist id="sites">{sites.map((one) => <option key={one} value={one} />)}</datalist>
      {id && !same && <Threshold id={id} known={found} value={threshold} write={type} />}
      <Gone now={on.value} reload={reload} />
      <Start id="subject-keep" why={same && id && site ? t.run.isOnBench : whyNot(id, site, threshold)}>{t.run.keepSubject}</Start>
      <p id="code-hint" class="quiet whole">{t.run.codeHint}</p>
    </form>
  );
}

export function SubjectStep({ subject, draft }: { subject: Loaded<OnBench>; draft: Draft }) {
  return (
    <Card id="step-subject" title={t.run.step(1, t.run.steps.subject)}>
      <Show loaded={subject}>{(on) => <Form key={`${on.value.id}/${on.value.site}`} on={on} reload={subject.reload} draft={draft} />}</Show>
    </Card>
  );
}
