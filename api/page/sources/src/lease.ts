// Whatever moves needs the lease: one page at a time, for as long as it shows itself.
import { effect, signal } from "@preact/signals";
import { Refused, ask, post } from "./api";
import { clockTime, opened } from "./clock";
import { failed, message } from "./attempt";
import { rig } from "./live";
import { place } from "./route";
import { t } from "./texts";

const PATH = "/api/v1/control/lease";
const LASTS_S = 5;
// A fifth of what a lease lasts.
const RENEW_MS = 1000;
// Somebody else, or nobody, is in control.
const LOCKED = 423;

export const lease = signal("");
/** Who logged in here, as others are told. */
export const holder = signal(t.holder(opened));
/** Somebody else was in control when this page wanted to be. */
export const occupied = signal(false);
/** Why this page is not in control any more. */
export const lost = signal("");

export const held = (): Record<string, string> => (lease.value ? { "X-Control-Lease": lease.value } : {});

const wanted = () => ({ holder: holder.value, ttl_s: LASTS_S, purpose: t.control.purposes[place.value.view] ?? t.views[place.value.view] });

function keep(identifier: string): void {
  lease.value = identifier;
  occupied.value = false;
  lost.value = "";
}

async function take(): Promise<void> {
  try {
    keep((await post(PATH, { body: wanted() })).lease_id);
  } catch (error) {
    occupied.value = error instanceof Refused && error.status === LOCKED;
    throw occupied.value ? new Error(refused((error as Refused).more)) : error;
  }
}

/** Who is in control, what for and since when, in words. */
export const told = (of: { holder?: string | null; purpose?: string | null; since?: string | null }): string =>
  t.control.told(of.holder ?? "", of.purpose ?? "", of.since ? clockTime(of.since) : "");

/** What was refused and by whom; whoever is signed in under one name twice is told that it may be their own window. */
const refused = (of: Refused["more"]) => (of.holder === holder.value ? t.control.refusedOwn(told(of)) : t.control.refused(told(of)));

/** A refusal is over once whoever was in control is not any more. */
let heldMeanwhile = false;
effect(() => {
  const other = Boolean(rig.value?.control.holder);
  if (occupied.value && heldMeanwhile && !other) {
    occupied.value = false;
    if (failed.peek()) message.value = "";
  }
  heldMeanwhile = occupied.value && other;
});

/** Takes control from whoever has it, who is told ``reason``. */
export async function takeOver(reason: string): Promise<void> {
  keep((await post("/api/v1/control/take", { body: { ...wanted(), reason } })).lease_id);
}

/** Does ``action`` with the lease in force. */
export async function inControl<T>(action: () => Promise<T>): Promise<T> {
  if (!lease.value) await take();
  return action();
}

export async function release(): Promise<void> {
  await ask("delete", PATH, { headers: held() });
  lease.value = "";
}

async function renew(): Promise<void> {
  const mine = lease.value;
  if (!mine) return;
  try {
    await ask("put", PATH, { headers: held() });
  } catch (error) {
    // Only 423 says that it is not ours: a service that does not answer, or is too busy to, may still hold it for us.
    // Nor is a new lease lost by the answer to an old one.
    if (!(error instanceof Refused) || error.status !== LOCKED || lease.value !== mine) return;
    lease.value = "";
    lost.value = gone(error);
  }
}

function gone({ more, message }: Refused): string {
  if (more.taken_by) return t.control.takenOver(more.taken_by, more.reason ?? "");
  return more.code === "no-lease" ? t.control.ranOut(more.holder ? told(more) : "") : message;
}

export function keepLease(): void {
  setInterval(renew, RENEW_MS);
  // Whoever leaves gives control back, which stops what moves: the browser asks first.
  window.addEventListener("beforeunload", (event) => {
    if (lease.value && rig.value?.state === "running") event.preventDefault();
  });
  window.addEventListener("pagehide", () => {
    // Without a service control has run out by itself.
    if (lease.value) fetch(PATH, { method: "DELETE", headers: held(), keepalive: true }).catch(() => undefined);
  });
}
