// One session: its curves, what they say of the tissue, what the simulation gets wrong, and everything to take away.
import { useState } from "preact/hooks";
import { every, get, type Schema } from "../api";
import { date } from "../clock";
import { ended, useWork, type Job } from "../jobs";
import { useLoaded } from "../loaded";
import { Show } from "../parts/basics";
import { Quality, worst } from "../parts/quality";
import { link } from "../route";
import { t } from "../texts";
import { Curves } from "./session/curves";
import { DiagnosisCard } from "./session/diagnosis";
import { FilesCard } from "./session/files";
import { FitCard } from "./session/fit";
import { TrackingCard } from "./session/tracking";
import { TrialsCard } from "./session/trials";

type Trials = Schema["TrialEntry"][];

function Head({ session, trials, of }: { session: Schema["SessionFiles"] | null; trials: Trials; of: string }) {
  const [first] = trials;
  return (
    <header class="session-head">
      <h1>{of}</h1>
      <p class="row quiet">
        {session && <span>{t.session.kinds[session.kind] ?? session.kind}</span>}
        {session && <span>{t.session.recorded(date(session.created))}</span>}
        {first?.subject && <a href={link("subjects", first.subject)}>{first.subject}{first.site && `, ${first.site}`}</a>}
        <Quality of={worst(trials.map((trial) => trial.quality))} />
      </p>
      {session?.remarks.map((remark) => <p key={remark} class="notice warn">{remark}</p>)}
    </header>
  );
}

/** How many recordings lie there of which the session's own list says nothing. */
const unlisted = ({ recordings, trials }: Schema["SessionFiles"]) => Math.max(0, recordings.filter((one) => one.file.endsWith(".mcap")).length - trials);

/** Counts what has ended here, so that what was read before is read again. */
const endings = (...jobs: (Job | null)[]) => jobs.map((job) => (ended(job) ? job!.id : "")).join(" ");

function One({ of }: { of: string }) {
  const [fit, followFit] = useWork<Schema["FitResult"]>("fit", of);
  const [diagnosis, followDiagnosis] = useWork<Schema["DiagnosisResult"]>("diagnose", of);
  const [more, again] = useState(0);
  const on = `${endings(fit, diagnosis)} ${more}`;
  const session = useLoaded(() => get("/api/v1/sessions/{session}", { path: { session: of } }), [of, on]);
  const trials = useLoaded(() => every("/api/v1/trials", { session: of }), [of, on]);
  return (
    <>
      <Head session={session.value} trials={trials.value ?? []} of={of} />
      <Show loaded={session}>
        {(found) => (
          <div class="grid session">
            <Curves of={of} on={on} />
            <FitCard of={of} job={fit} follow={followFit} />
            <DiagnosisCard of={of} job={diagnosis} follow={followDiagnosis} />
            <TrialsCard of={of} trials={trials} unlisted={unlisted(found)} />
            <TrackingCard of={of} />
            <FilesCard of={of} session={found} changed={() => again((n) => n + 1)} />
          </div>
        )}
      </Show>
    </>
  );
}

export function Session({ of }: { of: string }) {
  if (of) return <One of={of} />;
  return (
    <>
      <h1>{t.session.title}</h1>
      <p><a href={link("sessions")}>{t.session.choose}</a></p>
    </>
  );
}
