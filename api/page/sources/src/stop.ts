// The way to a stop: a process of its own on a port of its own, so that a busy, stopped or dead service does not matter.
// The service is asked as well; whichever answers first for the loop confirms. A page that came encrypted asks the one
// for other computers, also on the bench's own: not every browser lets it ask 127.0.0.1 without encryption.
import { signal } from "@preact/signals";
import type { Schema } from "./api";
import { t } from "./texts";

export type StopKind = "estop" | "pain";
export interface Stop {
  kind: StopKind;
  state: "pending" | "confirmed" | "unconfirmed";
  text: string;
}

const CONFIRM_MS = 1500;
const AGAIN_MS = 1000;
const ENCRYPTED = location.protocol === "https:";
export const stop = signal<Stop | null>(null);
/** Whether there is, for now, no way to a stop but through the service. */
export const alone = signal(false);
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

export async function pressStop(kind: StopKind): Promise<void> {
  const signal = AbortSignal.timeout(CONFIRM_MS);
  stop.value = { kind, state: "pending", text: t.stop.pending(kind) };
  const ways = [...besides(kind, signal), askForStop(`/api/v1/${kind}`, signal, "same-origin")];
  try {
    stop.value = { kind, state: "confirmed", text: t.stop.confirmed(kind, await Promise.any(ways)) };
  } catch (error) {
    const why = (error as AggregateError).errors.map((one: Error) => one.message).join("; ");
    stop.value = { kind, state: "unconfirmed", text: t.stop.unconfirmed(kind, why) };
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
