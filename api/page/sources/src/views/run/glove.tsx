// The pain threshold by three presses with a glove; the bench stands still.
import { useState } from "preact/hooks";
import type { Schema } from "../../api";
import { attempt } from "../../attempt";
import { ended, startInControl, useWork } from "../../jobs";
import { shown } from "../../parts/basics";
import { useGlove } from "../../parts/gloves";
import { JobState } from "../../parts/job";
import { Start, whyNotMove } from "../../parts/may";
import { atMost, keepSubject, type OnBench } from "../../subject";
import { t } from "../../texts";

type Found = Schema["GloveThreshold"];

export function Glove({ on, reload }: { on: OnBench; reload: () => void }) {
  const [session, name] = useState(`thresholds-${on.value.id}`);
  const [job, follow] = useWork<Found>("threshold-glove");
  const glove = useGlove("glove-input");
  const begin = (event: Event) => {
    event.preventDefault();
    void attempt(async () => follow((await startInControl<Found>("threshold-glove", { session, ...glove.asked })).id));
  };
  return (
    <>
      <p>{t.run.gloveText}</p>
      {(!job || ended(job)) && (
        <form onSubmit={begin}>
          <label>{t.run.gloveSession}
            <input id="glove-session" required maxLength={80} value={session} onInput={(event) => name(event.currentTarget.value)} />
          </label>
          {glove.choice}
          <Start id="glove-start" why={whyNotMove() || (session ? glove.why : t.run.gloveNoSession)}>{t.run.gloveStart}</Start>
        </form>
      )}
      <JobState job={job} />
      {job?.result && <Answer found={job.result} on={on} reload={reload} />}
    </>
  );
}

function Answer({ found, on, reload }: { found: Found; on: OnBench; reload: () => void }) {
  const force_N = found.force_N ?? 0;
  const limit_N = atMost(force_N);
  const known = on.value.site_thresholds_N;
  const keep = () => attempt(() => keepSubject(on, { site_thresholds_N: { ...known, [found.site]: limit_N } })).then(reload);
  const isOpen = found.subject === on.value.id && limit_N > 0 && limit_N !== known[found.site];
  return (
    <div class="notice" id="glove-result">
      <ol>{found.presses.map((one, number) => <li key={number}>{t.run.glovePress(number + 1, shown(one.peak_N, 1), one.refused ?? "")}</li>)}</ol>
      <p>{t.run.gloveFound(shown(force_N, 2), found.subject, found.site, found.rule)}</p>
      {isOpen && <Start id="glove-keep" why={whyNotMove()} onClick={() => void keep()}>{t.run.gloveKeep(shown(limit_N, 1), found.site)}</Start>}
    </div>
  );
}
