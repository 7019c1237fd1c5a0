// Fourth step: the run, and the card that says what came of it and what to do next.
import { useState } from "preact/hooks";
import type { Schema } from "../../api";
import { attempt } from "../../attempt";
import { sessionName } from "../../clock";
import { ended, startInControl, useWork, type Job } from "../../jobs";
import { Card, shown } from "../../parts/basics";
import { JobState } from "../../parts/job";
import { Start, whyNotMove } from "../../parts/may";
import { Now } from "../../parts/now";
import { Quality, worst } from "../../parts/quality";
import { link } from "../../route";
import { t } from "../../texts";

// As the service takes it: a folder is called so on every system.
const NAME = /^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$/;

type Captured = Schema["CaptureResult"];

export function Result({ job }: { job: Job<Captured> }) {
  const { result } = job;
  if (!result) return null;
  const kept = result.trials.filter((trial) => !result.trials.some((other) => other.repeats === trial.name));
  const verdict = worst(kept.map((trial) => trial.quality));
  const peak_N = Math.max(...kept.map((trial) => trial.peak_force_N ?? NaN).filter(Number.isFinite));
  const reasons = [...new Set(kept.flatMap((trial) => trial.reasons))];
  const session = job.session ?? result.session;
  return (
    <div class="notice result" id="result" data-quality={verdict}>
      <h3>{t.run.result(session)}</h3>
      <dl class="facts large">
        <div><dt>{t.run.quality}</dt><dd><Quality of={verdict} /></dd></div>
        <div><dt>{t.run.peak}</dt><dd><span id="peak">{shown(peak_N)}</span> <small>N</small></dd></div>
        <div><dt>{t.run.recorded}</dt><dd>{result.recordings}</dd></div>
        <div><dt>{t.run.lost}</dt><dd>{result.dropped}</dd></div>
      </dl>
      {reasons.length > 0 && <ul>{reasons.slice(0, 5).map((reason) => <li key={reason}>{reason}</li>)}</ul>}
      <p id="next"><strong>{t.run.next}</strong> {t.run.nextAfter[verdict === "bad" ? "bad" : "good"]}</p>
      <a id="open-session" class="button primary" href={link("session", session)}>{t.run.open}</a>
    </div>
  );
}

export function GoStep({ protocol, refusal }: { protocol: string; refusal: string }) {
  const [session, name] = useState(sessionName());
  const [job, follow] = useWork<Captured>("capture");
  const running = job && !ended(job);
  const isName = NAME.test(session);
  const begin = (event: Event) => {
    event.preventDefault();
    void attempt(async () => {
      follow((await startInControl<Captured>("capture", { protocol, session })).id);
      name(sessionName());
    });
  };
  return (
    <Card id="step-go" title={t.run.step(4, t.run.steps.go)}>
      {!running && (
        <form id="start" onSubmit={begin}>
          <label>{t.run.session}
            <input id="session" required autocomplete="off" value={session} aria-invalid={!isName} aria-describedby="session-hint" onInput={(event) => name(event.currentTarget.value)} />
          </label>
          <Start id="capture-start" why={refusal || (isName ? whyNotMove() : t.run.noName)}>{t.run.start}</Start>
          <p id="session-hint" class="quiet whole">{t.run.sessionHint}</p>
        </form>
      )}
      {running && <Now of={["force", "depth"]} />}
      <JobState job={job} />
      {job && ended(job) && <Result job={job} />}
    </Card>
  );
}
