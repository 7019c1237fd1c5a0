// What the bench is doing now: the newest view of it, and the last minutes of every quantity.
import { computed, signal } from "@preact/signals";
import { get, type Schema } from "./api";
import { learnStopPort, lookPast, outlive, past } from "./stop";
import { Stream, type Batch, type RigEvent } from "./stream";
import { Trace } from "./trace";

export type Rig = Schema["RigView"];
export type Contact = "connecting" | "live" | "old" | "silent";

// The service says something every 0.2 s at least: what is older than half a second is shown as old. A busy computer
// holds it back for a few tenths, so that what is shown is taken away only after twice that.
const OLD_MS = 500;
const SILENT_MS = 1000;
const LOOK_MS = 100;
// State, devices and jobs change by what people do; four looks a second are seen as at once.
const VIEW_MS = 250;
// Numbers that change faster cannot be read.
const NUMBERS_MS = 125;
// Two hundred parts a second with their least and greatest: a screen shows no more of half a minute.
const RATE_HZ = 200;
const MARKER_HZ = 100;
// Two minutes of that, and half a minute to go back to.
const CAPACITY = 60_000;
const EVENTS = 200;
// Many times the noise, and more than a zero of a few minutes ago is wrong by; it has gone once it is below the other.
const PRESSES_N = 0.3;
const GONE_N = 0.2;
const AT_REST = ["idle", "safe"];

export const QUANTITIES = ["force", "setpoint", "error", "depth", "position", "marker"] as const;
export type Quantity = (typeof QUANTITIES)[number];

export const rig = signal<Rig | null>(null);
export const contact = signal<Contact>("connecting");
export const fresh = computed(() => contact.value === "live");
export const numbers = signal<Partial<Record<Quantity, number | null>>>({});
export const events = signal<RigEvent[]>([]);
/** The force with which the tip presses though nothing moves it [N]; null where it does not. */
export const pressing = signal<number | null>(null);
/** When the bench's clock was zero, in milliseconds since 1970; 0 where that is not known yet. */
export const started_ms = signal(0);
/** Samples that this page did not get in time, of all streams. */
export const missed = signal(0);
export const traces = Object.fromEntries(QUANTITIES.map((name) => [name, new Trace(CAPACITY)])) as Record<Quantity, Trace>;

let heard_ms = performance.now();
let viewed_ms = performance.now();
let newest_s = 0;
let newestAt_ms = 0;
let origin: number[] | null = null;

/** Now on the bench's clock [s]: its greeting or the newest sample, carried on by this computer's clock between batches. */
export function now_s(): number {
  return newest_s + (fresh.value ? Math.min(0.1, (performance.now() - newestAt_ms) * 1e-3) : 0);
}

function keep(batch: Batch): void {
  if (batch.stream === "marker") keepMarker(batch);
  else {
    const trace = traces[batch.stream as Quantity];
    const [least, greatest] = batch.values;
    batch.times_s.forEach((time_s, i) => {
      trace.push(time_s, least![i]!);
      // Half of a part later, so that both are drawn.
      if (greatest && greatest[i] !== least![i]) trace.push(time_s + 0.5 / RATE_HZ, greatest[i]!);
    });
  }
  // What was kept of the last minute comes first: it is not what the bench does now.
  if (batch.times_s.at(-1)! > newest_s) see(batch.times_s.at(-1)!);
}

function see(bench_s: number): void {
  newest_s = bench_s;
  newestAt_ms = performance.now();
}

/** How far the marker is from where it was first seen, whichever way the tracker stands. */
function keepMarker({ times_s, values }: Batch): void {
  times_s.forEach((time_s, i) => {
    const here = values.map((column) => column[i]!);
    if (!origin && here.every(Number.isFinite)) origin = here;
    traces.marker.push(time_s, origin ? Math.hypot(...here.map((value, axis) => value - origin![axis]!)) : NaN);
  });
}

function forget(): void {
  for (const name of QUANTITIES) traces[name].clear();
  origin = null;
}

const known = (value: number) => (Number.isFinite(value) ? value : null);

function showNumbers(): void {
  if (contact.value === "silent") numbers.value = {};
  else numbers.value = Object.fromEntries(QUANTITIES.map((name) => [name, known(traces[name].value(newest_s, SILENT_MS * 1e-3))]));
}

async function learn(): Promise<void> {
  const { monotonic_ns } = await learnStopPort();
  started_ms.value = Date.now() - monotonic_ns * 1e-6;
}

function pressesWith({ state, mode, job, force_N }: Rig): number | null {
  const moved = state === "running" || job || !AT_REST.includes(mode ?? "");
  return !moved && (force_N ?? 0) > (pressing.value === null ? PRESSES_N : GONE_N) ? force_N! : null;
}

async function look(): Promise<void> {
  const before = rig.value?.state;
  const asked_ms = performance.now();
  try {
    rig.value = await get("/api/v1/rig", { signal: AbortSignal.timeout(2 * SILENT_MS) });
    viewed_ms = performance.now();
    pressing.value = pressesWith(rig.value);
    outlive(before, rig.value.state, asked_ms);
    // Each start of the bench has a stop process of its own, also while it homes and is not connected yet.
    if ([before, rig.value.state].includes("disconnected")) void learn();
  } catch {
    // Silence is shown by the clock, whatever the reason.
  }
  setTimeout(look, VIEW_MS);
}

// A service that was stopped or hangs keeps its connection open and says nothing: only the clock tells.
function watch(): void {
  const now_ms = performance.now();
  const silence_ms = Math.max(now_ms - heard_ms, now_ms - viewed_ms - VIEW_MS);
  if (contact.value === "connecting" && !rig.value && silence_ms < 3 * SILENT_MS) return;
  contact.value = silence_ms > SILENT_MS ? "silent" : silence_ms > OLD_MS ? "old" : "live";
}

/** What a stop still does is asked for as long as nobody else says how the bench is. */
async function lookForStop(): Promise<void> {
  if (contact.value === "silent") await lookPast();
  else past.value = "unknown";
  setTimeout(lookForStop, SILENT_MS);
}

export function listen(): void {
  const stream = new Stream(
    [
      { streams: ["force", "setpoint", "error", "depth", "position"], max_rate_hz: RATE_HZ, decimate: "minmax" },
      { streams: ["marker"], max_rate_hz: MARKER_HZ, decimate: "last" },
    ],
    {
      message: () => void (heard_ms = performance.now()),
      // A service that has ended closes what it had open: that is told at once, and not by the clock.
      closed: () => {
        heard_ms = performance.now() - 2 * SILENT_MS;
        watch();
      },
      open: (bench_s) => {
        see(bench_s);
        void learn();
      },
      run: () => (forget(), void learn()),
      batch: keep,
      event: (event) => {
        events.value = [event, ...events.value].slice(0, EVENTS);
        if (event.code.startsWith("away-stops")) void learn();
      },
      gap: (_, dropped) => void (missed.value += dropped),
    },
  );
  stream.open();
  void look();
  void lookForStop();
  setInterval(watch, LOOK_MS);
  setInterval(showNumbers, NUMBERS_MS);
}
