// All data of a subject: in one archive to take along, or erased in two steps.
import { useState } from "preact/hooks";
import { address, remove, type Answer } from "../../api";
import { attempt } from "../../attempt";
import { whyNotWork } from "../../parts/may";
import { Card } from "../../parts/basics";
import { go } from "../../route";
import { may } from "../../session";
import { t } from "../../texts";

type Plan = Answer<"/api/v1/subjects/{subject}", "delete">;
const PATH = "/api/v1/subjects/{subject}";

function Erase({ code }: { code: string }) {
  const [plan, show] = useState<Plan | null>(null);
  const [typed, type] = useState("");
  const look = () => void attempt(async () => show(await remove(PATH, { path: { subject: code } })));
  const erase = (event: Event) => {
    event.preventDefault();
    void attempt(async () => {
      // Something else may be there by now than was shown: then this is refused, and it is looked at again.
      const done = await remove(PATH, { path: { subject: code }, query: { confirm: plan!.confirm } }).finally(() => show(null));
      go("subjects");
      return t.subjects.erased(done.subject, done.sessions.length);
    });
  };
  if (!may("admin")) return <p class="quiet">{t.subjects.eraseAdmin}</p>;
  if (!plan) return <button id="erase" type="button" class="danger" disabled={Boolean(whyNotWork())} onClick={look}>{t.subjects.erase}</button>;
  return (
    <form id="erase-plan" class="notice bad" onSubmit={erase} aria-label={t.subjects.erase}>
      <div>
        <p><strong>{t.subjects.wouldGo(plan.sessions.length, plan.files, plan.bytes / 1e6)}</strong></p>
        <p>{plan.statement}</p>
        {plan.sessions.length > 0 && <details><summary>{t.subjects.which}</summary><ul>{plan.sessions.map((one) => <li key={one}>{one}</li>)}</ul></details>}
      </div>
      <label>{t.subjects.typeCode(code)}
        <input id="erase-code" autocomplete="off" value={typed} onInput={(event) => type(event.currentTarget.value)} />
      </label>
      <button id="erase-now" type="submit" class="danger" disabled={typed !== code}>{t.subjects.eraseNow}</button>
      <button type="button" onClick={() => { show(null); type(""); }}>{t.subjects.keep}</button>
    </form>
  );
}

export function Whole({ code }: { code: string }) {
  return (
    <div class="grid">
      <Card title={t.subjects.take}>
        <p>{t.subjects.takeText}</p>
        {may("operate") ? <a id="export" class="button" download href={address(`${PATH}/export`, { path: { subject: code } })}>{t.subjects.export}</a> : <p class="quiet">{t.may.look}</p>}
      </Card>
      <Card title={t.subjects.eraseTitle}>
        <p>{t.subjects.eraseText}</p>
        <Erase code={code} />
      </Card>
    </div>
  );
}
