// Who is in control of the bench, and how it changes hands.
import { signal } from "@preact/signals";
import { useState } from "preact/hooks";
import { attempt } from "../attempt";
import { lease, lost, occupied, release, takeOver, told } from "../lease";
import { contact, rig } from "../live";
import { may } from "../session";
import { t } from "../texts";
import { Dialog } from "./dialog";

const asking = signal(false);
const SHORTEST_REASON = 3;

/** Asks for a reason and takes control from whoever has it; what moves is stopped by that, so that it is said first. */
function Takeover() {
  const [reason, give] = useState("");
  const now = rig.value?.control;
  const moving = rig.value?.state === "running";
  const allowed = !moving || may("admin");
  const close = () => void (asking.value = false);
  const take = async (event: Event) => {
    event.preventDefault();
    asking.value = false;
    await attempt(async () => {
      await takeOver(reason.trim());
      give("");
      return t.control.taken;
    });
  };
  return (
    <Dialog id="takeover" title={t.control.takeOver} open={asking.value} close={close}>
      <p id="takeover-holder">{now?.holder ? told(now) : t.control.nobody}</p>
      {moving && <p class="notice bad">{allowed ? t.control.stopsWork : t.control.mayNotStop}</p>}
      <form onSubmit={take}>
        <label class="full">{t.control.reason}
          <input id="takeover-reason" required autofocus minLength={SHORTEST_REASON} maxLength={200} value={reason} onInput={(event) => give(event.currentTarget.value)} />
        </label>
        <button type="submit" class={moving ? "danger" : "primary"} disabled={!allowed}>{t.control.take}</button>
        <button type="button" onClick={close}>{t.control.leave}</button>
      </form>
    </Dialog>
  );
}

export function Control() {
  const now = rig.value?.control;
  const holder = now?.holder ?? "";
  const mine = Boolean(lease.value);
  // What is old says nothing of who is in control now.
  const known = contact.value !== "silent";
  const text = !known ? t.control.unknown : !now || !holder ? t.control.nobody : mine ? t.control.mine(holder) : told(now);
  return (
    <div class="control" role="group" aria-label={t.control.label}>
      <p id="control" class="quiet">{text}</p>
      {mine && rig.value?.state !== "running" && <button id="release" class="small" type="button" onClick={() => void attempt(release)}>{t.control.release}</button>}
      {known && !mine && holder && may("operate") && <TakeButton id="take-over" />}
      <Takeover />
    </div>
  );
}

function TakeButton({ id }: { id: string }) {
  return <button id={id} class="small" type="button" aria-haspopup="dialog" onClick={() => void (asking.value = true)}>{t.control.takeOver}</button>;
}

/** After a refusal because somebody else is in control, or a loss of control: the way to it, where that is said. */
export function TakeHere() {
  const other = !lease.value && rig.value?.control.holder;
  return other && (occupied.value || lost.value) && may("operate") ? <TakeButton id="take-here" /> : null;
}
