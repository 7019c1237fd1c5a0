// Everything to take away: the report, the recordings as they are and in the formats of others, and whether they are whole.
import { useState } from "preact/hooks";
import { save, type Schema } from "../../api";
import { attempt } from "../../attempt";
import { ended, start, useWork } from "../../jobs";
import { Card, sizeOf } from "../../parts/basics";
import { JobState } from "../../parts/job";
import { Start, whyNotWork } from "../../parts/may";
import { t } from "../../texts";

// What a demonstration was made with: it would give away what its diagnosis is to find.
const TRUTH = "diagnosis/truth.txt";
const FORMATS = ["csv", "parquet", "hdf5", "mat", "mcap"] as const;
type Session = Schema["SessionFiles"];

function Report({ of, session, changed }: { of: string; session: Session; changed: () => void }) {
  const [job, follow] = useWork("report", of);
  const running = job && !ended(job);
  const report = session.files.find((file) => file.name.endsWith(".html"));
  const made = job?.files?.find((file) => file.name.endsWith(".html"))?.href ?? report?.href;
  const begin = () => void attempt(async () => { follow((await start("report", { session: of })).id); changed(); });
  return (
    <>
      <JobState job={job} />
      <div class="row">
        {made && <a id="report" class="button primary" href={made} target="_blank" rel="noopener">{t.session.reportOpen}</a>}
        {made && <a id="report-save" class="button" href={made} download>{t.session.report}</a>}
        {!running && <Start id="report-start" quiet={Boolean(made)} why={whyNotWork()} onClick={begin}>{made ? t.session.reportAgain : t.session.reportMake}</Start>}
      </div>
    </>
  );
}

function Exports({ of }: { of: string }) {
  const [making, make] = useState("");
  const take = async (form: string) => {
    if (making) return;
    make(form);
    await attempt(() => save("/api/v1/sessions/{session}/export/{form}", { path: { session: of, form } }));
    make("");
  };
  return (
    <>
      <h3>{t.session.exports}</h3>
      <div class="row">
        {FORMATS.map((form) => <button key={form} id={`export-${form}`} type="button" class="small" aria-busy={making === form} onClick={() => void take(form)}>{t.session.format[form]}</button>)}
      </div>
      {making && <p class="quiet" role="status" id="exporting">{t.session.exporting}</p>}
    </>
  );
}

function Whole({ of }: { of: string }) {
  const [job, follow] = useWork<Schema["VerifyResult"]>("verify", of);
  const begin = () => void attempt(async () => follow((await start<Schema["VerifyResult"]>("verify", { session: of })).id));
  const wrong = Object.entries(job?.result?.recordings ?? {}).filter(([, one]) => !one.ok);
  const said = job?.result && (job.result.ok ? t.session.whole : wrong.length ? t.session.damaged : t.session.wholeBut);
  return (
    <>
      <JobState job={job} />
      {said && <p id="whole" class={job.result!.ok ? "notice" : "notice bad"}>{said}</p>}
      {wrong.map(([name, one]) => <p key={name} class="notice bad">{name}: {one.sentence}</p>)}
      {job?.result?.remarks.map((remark) => <p key={remark} class="notice warn">{remark}</p>)}
      {(!job || ended(job)) && <Start id="verify-start" quiet why={whyNotWork()} onClick={begin}>{t.session.verify}</Start>}
    </>
  );
}

export function FilesCard({ of, session, changed }: { of: string; session: Session; changed: () => void }) {
  const files = session.files.filter((file) => file.name !== TRUTH);
  return (
    <Card id="files-card" title={t.session.files}>
      <Report of={of} session={session} changed={changed} />
      <Exports of={of} />
      <h3>{t.session.verifyTitle}</h3>
      <Whole of={of} />
      <details>
        <summary>{t.sessions.filesOf(files.length + session.files_left_out)}</summary>
        <ul id="files">{files.map((file) => <li key={file.name}><a href={file.href} download>{file.name}</a> <span class="quiet">{sizeOf(file.bytes)}</span></li>)}</ul>
        {session.files_left_out > 0 && <p id="not-listed" class="quiet">{t.sessions.notListed(session.files_left_out)}</p>}
      </details>
    </Card>
  );
}
