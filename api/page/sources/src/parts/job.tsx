// One piece of work: how far it is, what it said, how it ended, and its end by hand.
import { useEffect, useRef, useState } from "preact/hooks";
import { attempt } from "../attempt";
import { duration } from "../clock";
import { ended, takeBegun, tell, type Job, type Verb } from "../jobs";
import { inControl } from "../lease";
import { t } from "../texts";
import { Dot } from "./basics";

// What is asked for next is shown half a second later: the second click of a double one must not answer that too.
const ANSWERED_MS = 1000;

const named = (job: Job) => t.kinds[job.kind] ?? job.kind;

function Left({ job }: { job: Job }) {
  const started = job.done > 0 && job.total > 0;
  return (
    <>
      <progress max={job.total || 1} value={started ? job.done : undefined} aria-label={t.job.of(named(job))} />
      <p class="quiet">{job.time_left_s != null ? t.job.left(duration(job.time_left_s)) : t.job.someTime}</p>
    </>
  );
}

function Verbs({ job }: { job: Job }) {
  const [answered, answer] = useState(false);
  // Whoever ends something needs no control of it; whoever lets it go on does.
  const does = (verb: Verb) => () => {
    if (verb === "resume") {
      answer(true);
      setTimeout(() => answer(false), ANSWERED_MS);
    }
    void attempt(() => (verb === "cancel" ? tell(job, verb) : inControl(() => tell(job, verb))));
  };
  return <div class="row">{job.can.map((verb) => <button key={verb} id={`${job.kind}-${verb}`} type="button" disabled={answered && verb === "resume"} onClick={does(verb)}>{t.job[verb]}</button>)}</div>;
}

function Log({ job }: { job: Job }) {
  if (!job.log.length) return null;
  return <details><summary>{t.job.log}</summary><pre tabIndex={0}>{job.log.join("\n")}</pre></details>;
}

function UnderWay({ job }: { job: Job }) {
  const card = useRef<HTMLDivElement>(null);
  // The button that started it is gone: the keyboard goes on from here, not from the top of the page.
  useEffect(() => {
    if (takeBegun(job.id) && (document.activeElement === document.body || !document.activeElement?.checkVisibility())) card.current!.focus();
  }, [job.id]);
  return (
    <div class="notice" id={`${job.kind}-under-way`} ref={card} tabIndex={-1}>
      <p role="status"><Dot kind="good" /> <strong>{t.job.states[job.state] ?? t.job.progress(named(job), job.message, job.done, job.total, job.unit)}</strong></p>
      {job.state === "paused" && <p id={`${job.kind}-asks`}><strong>{job.message}</strong></p>}
      <Left job={job} />
      <Verbs job={job} />
      <Log job={job} />
    </div>
  );
}

/** How ``job`` stands or why it has no result; what a view makes of its result stands beside it, not in it. */
export function JobState({ job }: { job: Job | null }) {
  if (!job || job.state === "succeeded") return null;
  if (ended(job)) {
    return (
      <div class="notice bad" role="alert" id={`${job.kind}-ended`}>
        <p><strong>{named(job)}: {t.job.ended[job.state] ?? job.state}</strong></p>
        <p>{job.problem?.detail ?? job.message}</p>
        <Log job={job} />
      </div>
    );
  }
  return <UnderWay job={job} />;
}
