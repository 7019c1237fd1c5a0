// First step: whom the session will be of.
import { useState } from "preact/hooks";
import { attempt } from "../../attempt";
import type { Loaded } from "../../loaded";
import { Card, Show } from "../../parts/basics";
import { Start, whyNotMove } from "../../parts/may";
import { keepSubject, useKnownSubjects, type OnBench } from "../../subject";
import { t } from "../../texts";

function Form({ on, reload }: { on: OnBench; reload: () => void }) {
  const [id, setId] = useState(on.value.id);
  const [site, setSite] = useState(on.value.site);
  const known = useKnownSubjects().value ?? [];
  const save = async (event: Event) => {
    event.preventDefault();
    await attempt(async () => (await keepSubject(on, { id, site }), t.run.subjectKept(id, site)));
    reload();
  };
  const sites = [...new Set(known.flatMap((one) => (one.subject === id || !id ? one.sites : [])))];
  const same = id === on.value.id && site === on.value.site;
  return (
    <form onSubmit={save} id="subject-form">
      <label>{t.run.code}
        <input id="subject-id" list="codes" required maxLength={80} autocomplete="off" value={id} onInput={(event) => setId(event.currentTarget.value)} aria-describedby="code-hint" />
      </label>
      <label>{t.run.site}
        <input id="subject-site" list="sites" maxLength={80} autocomplete="off" value={site} onInput={(event) => setSite(event.currentTarget.value)} />
      </label>
      <datalist id="codes">{known.map((one) => <option key={one.subject} value={one.subject} />)}</datalist>
      <datalist id="sites">{sites.map((one) => <option key={one} value={one} />)}</datalist>
      <Start id="subject-keep" why={same ? (id ? t.run.isOnBench : "") : whyNotMove()}>{t.run.keepSubject}</Start>
      <p id="code-hint" class="quiet whole">{t.run.codeHint}</p>
    </form>
  );
}

export function SubjectStep({ subject }: { subject: Loaded<OnBench> }) {
  return (
    <Card id="step-subject" title={t.run.step(1, t.run.steps.subject)}>
      <Show loaded={subject}>{(on) => <Form key={`${on.value.id}/${on.value.site}`} on={on} reload={subject.reload} />}</Show>
    </Card>
  );
}
