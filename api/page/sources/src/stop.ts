// The way to a stop: a process of its own on a port of its own, so that a busy, stopped or dead service does not matter.
// The service is asked as well; whichever answers first for the loop confirms. A page that came encrypted asks the one
// for other computers, also on the bench's own: not every browser lets it ask 127.0.0.1 without encryption.
import { signal } from "@preact/signals";
import type { Schema } from "./api";
import { timeOf } from "./clock";
import { t } from "./texts";

export type StopKind = "estop" | "pain";
export interface Stop {
  kind: StopKind;
  state: "pending" | "confirmed" | "unconfirmed";
  text: string;
  /** When that was known: on this page's own clock, and as a person reads it. */
  at_ms: number;
  at: string;
}

const CONFIRM_MS = 1500;
const AGAIN_MS = 1000;
// Longer than the loop takes to say of itself what it has done.
const TAKEN_MS = 500;
const ENCRYPTED = location.protocol === "https:";
export const stop = signal<Stop | null>(null);
/** Whether there is, for now, no way to a stop but through the service. */
export const alone = signal(false);
/** Whether the bench has been seen stopped since that stop. */
let seen = false;
let stopPort = 0;
let away = "";

async function info(): Promise<Schema["Info"]> {
  const answer = await fetch("/api/v1/info", { signal: AbortSignal.timeout(5 * AGAIN_MS) });
  if (!answer.ok) throw new Error(answer.statusText);
  return answer.json();
}

async function learned(): Promise<Schema["Info"]> {
  for (;;) {
    const found = await info().catch(() => null);
    if (found) {
      stopPort = found.stop_port || stopPort;
      away = found.away_stops || away;
      alone.value = ENCRYPTED && !found.away_stops;
      return found;
    }
    await new Promise((later) => setTimeout(later, AGAIN_MS));
  }
}

/** Whether a stop goes past the service now, as far as a page can tell: it is asked for while the service is silent. */
export const past = signal<"works" | "gone" | "unknown">("unknown");

export async function lookPast(): Promise<void> {
  if (ENCRYPTED || !stopPort) return;
  const asked = fetch(`${location.protocol}//127.0.0.1:${stopPort}/state`, { signal: AbortSignal.timeout(AGAIN_MS), credentials: "omit" });
  const { loop } = await asked.then((answer) => answer.json()).catch(() => ({ loop: "gone" }));
  past.value = loop === "running" ? "works" : loop === "gone" ? "gone" : "unknown";
}

let learning: ReturnType<typeof learned> | null = null;
/** Also what else the service says of itself; asked until it answers: a way to a stop must not hang on one request. */
export const learnStopPort = () => (learning ??= learned().finally(() => void (learning = null)));

function besides(kind: StopKind, signal: AbortSignal): Promise<string>[] {
  if (ENCRYPTED) return away ? [askForStop(`${away}/${kind}`, signal, "include")] : [];
  return stopPort ? [askForStop(`${location.protocol}//127.0.0.1:${stopPort}/${kind}`, signal, "omit")] : [];
}

async function askForStop(url: string, signal: AbortSignal, credentials: RequestCredentials): Promise<string> {
  const answer = await (await fetch(url, { method: "POST", signal, credentials })).json();
  if (answer.confirmed === true) return `${answer.done} (stop ${answer.id}, ${answer.after_ms} ms)`;
  if (answer.done === true) return answer.detail;
  throw new Error(answer.done || answer.detail || answer.error);
}

function say(kind: StopKind, state: Stop["state"], text: string): void {
  stop.value = { kind, state, text, at_ms: performance.now(), at: timeOf(Date.now()) };
}

/** Takes back what was said of a stop once it is over: it was acknowledged, or something moves anew. */
export function outlive(before: string | undefined, now: string, asked_ms: number): void {
  const said = stop.value;
  // What was asked before the stop was answered may be from before it.
  if (!said || said.state === "pending" || asked_ms < said.at_ms) return;
  const acknowledged = seen && now !== "stopped" && now !== "disconnected";
  const moves = before !== undefined && before !== "running" && now === "running" && asked_ms > said.at_ms + TAKEN_MS;
  seen ||= now === "stopped";
  if (acknowledged || moves) stop.value = null;
}

export async function pressStop(kind: StopKind): Promise<void> {
  const signal = AbortSignal.timeout(CONFIRM_MS);
  seen = false;
  say(kind, "pending", t.stop.pending(kind));
  const ways = [...besides(kind, signal), askForStop(`/api/v1/${kind}`, signal, "same-origin")];
  try {
    say(kind, "confirmed", t.stop.confirmed(kind, await Promise.any(ways)));
  } catch (error) {
    const why = (error as AggregateError).errors.map((one: Error) => one.message).join("; ");
    say(kind, "unconfirmed", t.stop.unconfirmed(kind, why));
  }
}

export function listenForEscape(): void {
  // Escape stops from wherever the focus is, also out of a dialog or a field.
  window.addEventListener(
    "keydown",
    (event) => {
      if (event.key === "Escape" && !event.repeat) void pressStop("estop");
    },
    { capture: true },
  );
  void learnStopPort();
}
