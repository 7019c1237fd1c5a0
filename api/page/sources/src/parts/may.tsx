// Whether something may be started here and now, and the sentence that says why not.
import type { ComponentChildren } from "preact";
import { lease } from "../lease";
import { contact, pressing, rig } from "../live";
import { may } from "../session";
import { t } from "../texts";

/** Why what needs no bench cannot be started; empty if it can. */
export function whyNotWork(): string {
  if (!may("operate")) return t.may.look;
  return contact.value === "silent" ? t.may.silent : "";
}

/** Why nothing that moves can be started; empty if it can. */
export function whyNotMove(): string {
  const now = rig.value;
  const why = whyNotWork();
  if (why || !now) return why || t.may.silent;
  if (now.state === "running" || now.job) return t.may.busy;
  if (now.state === "disconnected") return t.may.disconnected;
  if (now.state === "stopped") return t.may.stopped;
  if (now.state === "not ready") return t.may.notReady;
  // Only where it is in: a zero that has moved keeps nobody from a run, which begins with another.
  if (pressing.value !== null && (now.depth_mm ?? 0) >= 0) return t.may.presses;
  return now.control.holder && !lease.value ? t.may.held(now.control.holder) : "";
}

/** A button that starts something; where ``why`` says that it cannot, that stands beside it. */
export function Start({ id, why, onClick, quiet = false, children }: { id: string; why: string; onClick?: () => void; quiet?: boolean; children: ComponentChildren }) {
  return (
    <span class="start">
      <button id={id} type={onClick ? "button" : "submit"} class={quiet ? "" : "primary"} disabled={Boolean(why)} aria-describedby={why ? `${id}-why` : undefined} onClick={onClick}>{children}</button>
      {why && <span id={`${id}-why`} class="quiet">{why}</span>}
    </span>
  );
}
