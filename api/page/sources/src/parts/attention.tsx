// What is in the way or under way, in every view below the stop: with the button that goes on from there.
import { signal } from "@preact/signals";
import { post, requestKey } from "../api";
import { attempt, failed, message } from "../attempt";
import { duration } from "../clock";
import { held, inControl, lost } from "../lease";
import { contact, fresh, pressing, rig } from "../live";
import { may } from "../session";
import { past, pressStop } from "../stop";
import { t } from "../texts";
import { shown } from "./basics";
import { TakeHere } from "./control";
import { Dialog } from "./dialog";

interface Question {
  told: string[];
  text: string;
  answer: (agreed: boolean) => void;
}
const question = signal<Question | null>(null);

const ask = (told: string[], text: string) =>
  new Promise<boolean>((resolve) => {
    question.value = { told, text, answer: resolve };
  });

// The service says what happened and what it needs consent for; nothing is done that was not agreed to by itself.
async function recover(): Promise<string> {
  const consent: Record<string, boolean> = {};
  for (;;) {
    const found = await post("/api/v1/recover", { body: consent as never, headers: { ...held(), ...requestKey() } });
    const [next] = found.open;
    if (!next) return found.ready ? t.attention.recovered(found.done.join("; ")) : t.attention.butMissing(found.missing);
    if (!(await ask(found.happened, next.question))) return t.attention.noConsent;
    consent[next.act] = true;
  }
}

function Consent() {
  const now = question.value;
  const answer = (agreed: boolean) => {
    const asked = question.value;
    question.value = null;
    asked?.answer(agreed);
  };
  return (
    <Dialog id="recovery" title={t.attention.recoveryTitle} open={Boolean(now)} close={() => answer(false)}>
      <ul id="recovery-told">{now?.told.map((line) => <li key={line}>{line}</li>)}</ul>
      <p id="recovery-question"><strong>{now?.text}</strong></p>
      <div class="row">
        <button type="button" class="primary" onClick={() => answer(true)}>{t.attention.yes}</button>
        <button type="button" autofocus onClick={() => answer(false)}>{t.attention.no}</button>
      </div>
    </Dialog>
  );
}

const moving = (action: () => Promise<unknown>) => () => void attempt(() => inControl(action));

export const retract = moving(async () => void (await post("/api/v1/jobs", { body: { kind: "retract", params: {} }, headers: { ...held(), ...requestKey() } })));
export const acknowledge = moving(async () => (await post("/api/v1/estop/reset", { headers: held() })).detail);
export const connect = moving(async () => void (await post("/api/v1/rig/connect", { headers: { ...held(), ...requestKey() } })));
export const startRecovery = moving(recover);

function Under() {
  const job = rig.value?.job;
  if (!job) return null;
  return (
    <section id="job" class="strip" aria-label={t.job.label}>
      <div class="grow">
        <p id="job-text">{t.job.text(job.name, job.message, job.done, job.total, job.unit)}</p>
        <progress id="job-bar" max={job.total || 1} value={job.done} aria-label={t.job.label} />
        {job.time_left_s != null && <p class="quiet">{t.job.left(duration(job.time_left_s))}</p>}
      </div>
      {may("operate") && <button id="job-stop" type="button" onClick={() => void attempt(() => post("/api/v1/jobs/{identifier}/cancel", { path: { identifier: job.id } }))}>{t.job.stop}</button>}
      <button id="pain" type="button" onClick={() => void pressStop("pain")}>{t.job.pain}</button>
    </section>
  );
}

function Needed() {
  const now = rig.value;
  if (!now || contact.value === "silent" || now.state === "idle" || now.state === "running") return null;
  return (
    <section class="strip bad" aria-label={t.attention.label}>
      <p id="reason" class="grow" role="alert">{now.reason}</p>
      {may("operate") ? <Ways /> : <p class="quiet">{t.may.look}</p>}
    </section>
  );
}

function Ways() {
  const { state, job } = rig.value!;
  return (
    <>
      {state === "stopped" && <button id="reset" type="button" disabled={Boolean(job)} onClick={acknowledge}>{t.attention.acknowledge}</button>}
      {state === "disconnected" && <button id="connect" type="button" onClick={connect}>{t.attention.connect}</button>}
      <button id="recover" type="button" onClick={startRecovery}>{t.attention.recover}</button>
    </>
  );
}

function Presses() {
  const now = rig.value;
  const force_N = pressing.value;
  if (!now || force_N === null || contact.value === "silent") return null;
  const out = (now.depth_mm ?? 0) < 0;
  return (
    <section class="strip bad" aria-label={t.attention.pressing}>
      <p id="presses" class="grow"><strong>{t.attention.presses(shown(force_N, 1), out, now.state === "stopped")}</strong></p>
      {now.state === "idle" && may("operate") && <button id="retract-now" type="button" class="primary" disabled={!fresh.value} title={t.attention.retractHint} onClick={retract}>{t.attention.retract}</button>}
    </section>
  );
}

function Said() {
  const text = lost.value || message.value;
  const bad = failed.value || lost.value;
  return (
    <div class={!text ? "" : bad ? "strip bad" : "strip"}>
      <p id="message" role="status" aria-live="polite" class={text ? "grow" : "hidden-when-empty"}>{text}</p>
      {bad && <TakeHere />}
    </div>
  );
}

export function Attention() {
  return (
    <>
      {contact.value === "silent" && <p id="reason" class="strip bad" role="alert">{t.silent} {t.silentStop[past.value]}</p>}
      <Needed />
      <Presses />
      <Under />
      <Said />
      <Consent />
    </>
  );
}
