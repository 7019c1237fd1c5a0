// What the simulation gets wrong, why, how much of the error that explains, and what to do about it.
import { ifThere, type Schema } from "../../api";
import { attempt } from "../../attempt";
import { ended, start, type Job } from "../../jobs";
import { useLoaded } from "../../loaded";
import { Card, Dot, Show, significant } from "../../parts/basics";
import { JobState } from "../../parts/job";
import { Start, whyNotWork } from "../../parts/may";
import { Pictures } from "../../parts/pictures";
import { t } from "../../texts";

type Diagnosis = Schema["DiagnosisResult"];
type Cause = Schema["NamedCause"];

const percent = (share: number | null | undefined) => (share == null ? t.unknown : `${Math.round(100 * share)} %`);

function Explained({ found }: { found: Diagnosis }) {
  const share = found.explained_share;
  return (
    <>
      <dl class="facts large">
        {share && <div class="lead"><dt>{t.diagnosis.share}</dt><dd id="share">{percent(share.value)}</dd></div>}
        <div><dt>{t.diagnosis.before}</dt><dd>{significant(found.base_N, 2)} <small>N</small></dd></div>
        <div><dt>{t.diagnosis.after}</dt><dd>{significant(found.extended_N, 2)} <small>N</small></dd></div>
        <div><dt>{t.diagnosis.floor}</dt><dd>{significant(found.floor_N, 2)} <small>N</small></dd></div>
      </dl>
      {share && <p class="quiet">{t.diagnosis.interval(percent(share.low), percent(share.high))}</p>}
    </>
  );
}

function Named({ cause }: { cause: Cause }) {
  return (
    <li class="cause">
      <h3>{cause.effects.map((name) => name.replaceAll("_", " ")).join(` ${t.diagnosis.or} `)}</h3>
      <p>{cause.statement}</p>
      <p class="quiet">
        {t.diagnosis.confidence(percent(cause.confidence))}{cause.provisional && ` · ${t.diagnosis.provisional}`}
        {` · ${t.diagnosis.gain(percent(cause.gain.reduction))}`}
      </p>
      {cause.repair && <p><strong>{t.diagnosis.repair}:</strong> {cause.repair}</p>}
    </li>
  );
}

function Found({ found, of, on }: { found: Diagnosis; of: string; on: string }) {
  const kind = ({ explained: "good", adequate: "good", unexplained: "warn", "not judged": "none" } as const)[found.verdict];
  return (
    <div id="diagnosis-result">
      <p class="said"><Dot kind={kind} /> <strong>{found.statement}</strong></p>
      <Explained found={found} />
      {found.findings.length ? <ul class="plain causes">{found.findings.map((cause) => <Named key={cause.statement} cause={cause} />)}</ul> : <p id="no-cause">{t.diagnosis.nothing[found.verdict]}</p>}
      {found.next_experiment && <p class="notice"><strong>{t.diagnosis.next}:</strong> {found.next_experiment.do}</p>}
      <Pictures session={of} folder="diagnosis" names={["share", "simulation", "residuals", "evidence"]} on={on} />
    </div>
  );
}

export function DiagnosisCard({ of, job, follow }: { of: string; job: Job<Diagnosis> | null; follow: (id: string) => void }) {
  const on = ended(job) ? job!.id : "";
  const loaded = useLoaded(() => ifThere<Diagnosis>("/api/v1/recordings/{session}/diagnosis/diagnosis.json", { path: { session: of } }).then((value) => [value]), [of, on]);
  const begin = () => void attempt(async () => follow((await start<Diagnosis>("diagnose", { session: of })).id));
  const running = job && !ended(job);
  return (
    <Card id="diagnosis-card" title={t.session.diagnosis} wide>
      <Show loaded={loaded}>
        {([found]) => (
          <>
            {found ? <Found found={found} of={of} on={on} /> : !running && <p>{t.diagnosis.none}</p>}
            <JobState job={job} />
            {!running && <Start id="diagnose-start" quiet={Boolean(found)} why={whyNotWork()} onClick={begin}>{found ? t.diagnosis.again : t.diagnosis.start}</Start>}
          </>
        )}
      </Show>
    </Card>
  );
}
