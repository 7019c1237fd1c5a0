// What the recordings say of the tissue.
import { ifThere, type Schema } from "../../api";
import { attempt } from "../../attempt";
import { ended, start, type Job } from "../../jobs";
import { useLoaded } from "../../loaded";
import { Card, Rows, Show, significant } from "../../parts/basics";
import { JobState } from "../../parts/job";
import { Start, whyNotWork } from "../../parts/may";
import { Pictures } from "../../parts/pictures";
import { t } from "../../texts";

type Fit = Schema["FitResult"];
type Law = Schema["LawResult"];

const laws = (fit: Fit) => Object.entries(fit as unknown as Record<string, Law>).filter(([, value]) => value && typeof value === "object" && "formula" in value);

function Parameters({ law }: { law: Law }) {
  return (
    <dl class="facts large" id="parameters">
      {Object.entries(law.parameters).map(([name, one]) => (
        <div key={name}>
          <dt>{t.fit.parameters[name] ?? name}</dt>
          <dd>{significant(one.value)} <small>{one.unit}</small></dd>
          <dd class="interval quiet">{one.known ? t.fit.known : t.fit.interval(significant(one.interval[0]), significant(one.interval[1]))}</dd>
        </div>
      ))}
    </dl>
  );
}

function Compared({ fit }: { fit: Fit }) {
  return (
    <Rows label={t.fit.laws} heads={[t.fit.law, t.fit.formula, t.fit.residual, t.fit.error]}>
      {laws(fit).map(([name, law]) => (
        <tr key={name}>
          <th scope="row">{name}{name === fit.model_law && ` (${t.fit.chosen})`}</th>
          <td><code>{law.formula}</code></td>
          <td>{significant(law.rmse_N, 2)} N</td>
          <td>{significant(law.held_out?.trials?.max_error_percent, 2)} %</td>
        </tr>
      ))}
    </Rows>
  );
}

function Found({ fit, of, on }: { fit: Fit; of: string; on: string }) {
  const law = laws(fit).find(([name]) => name === fit.model_law)?.[1];
  return (
    <div id="fit-result">
      <p>{t.fit.says(fit.model_law, fit.trials.length)}</p>
      {law && <Parameters law={law} />}
      {fit.remarks?.map((remark) => <p key={remark} class="notice warn">{remark}</p>)}
      <Pictures session={of} folder="fit" names={["fit", "residuals"]} on={on} />
      <details><summary>{t.fit.laws}</summary><Compared fit={fit} /></details>
    </div>
  );
}

export function FitCard({ of, job, follow }: { of: string; job: Job<Fit> | null; follow: (id: string) => void }) {
  const on = ended(job) ? job!.id : "";
  const fit = useLoaded(() => ifThere<Fit>("/api/v1/recordings/{session}/fit/fit.json", { path: { session: of } }).then((value) => [value]), [of, on]);
  const begin = () => void attempt(async () => follow((await start<Fit>("fit", { sessions: [of] })).id));
  const running = job && !ended(job);
  return (
    <Card id="fit-card" title={t.session.fit} wide>
      <Show loaded={fit}>
        {([found]) => (
          <>
            {found ? <Found fit={found} of={of} on={on} /> : !running && <p>{t.fit.none}</p>}
            <JobState job={job} />
            {!running && <Start id="fit-start" quiet={Boolean(found)} why={whyNotWork()} onClick={begin}>{found ? t.fit.again : t.fit.start}</Start>}
          </>
        )}
      </Show>
    </Card>
  );
}
