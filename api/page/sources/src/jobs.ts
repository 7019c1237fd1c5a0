// Work that takes longer than an answer: it is started, goes on whoever looks, and leaves a result.
import { useEffect, useState } from "preact/hooks";
import { ask, requestKey, unanswered } from "./api";
import { held, inControl } from "./lease";
import { rig } from "./live";

export type JobState = "queued" | "running" | "pausing" | "paused" | "cancelling" | "succeeded" | "failed" | "cancelled" | "interrupted";
export type Verb = "cancel" | "pause" | "resume";

export interface JobFile {
  name: string;
  href: string;
  bytes: number;
}

export interface Job<R = unknown> {
  id: string;
  kind: string;
  name: string;
  state: JobState;
  session: string | null;
  params: Record<string, unknown>;
  done: number;
  total: number;
  unit: string;
  message: string;
  time_left_s: number | null;
  can: Verb[];
  log: string[];
  result: R | null;
  problem: { code: string; detail: string } | null;
  files: JobFile[];
}

const ENDED: JobState[] = ["succeeded", "failed", "cancelled", "interrupted"];
export const ended = (job: { state: string } | null) => Boolean(job && ENDED.includes(job.state as JobState));
// A person sees a bar that moves twice a second as moving.
const LOOK_MS = 500;

/** Starts work that needs no control of the bench. */
export async function start<R>(kind: string, params: Record<string, unknown>): Promise<Job<R>> {
  const job = (await ask("post", "/api/v1/jobs", { body: { kind, params }, headers: { ...held(), ...requestKey() } })) as Job<R>;
  begun = job.id;
  return job;
}

/** The job that was started here last; whoever shows it first takes it. */
let begun = "";
export const takeBegun = (id: string) => id === begun && ((begun = ""), true);

/** Starts work that moves, or writes where others could: with the lease. */
export const startInControl = <R>(kind: string, params: Record<string, unknown>) => inControl(() => start<R>(kind, params));

/** Asks that job, and no other, to end, pause or go on. */
export const tell = (job: { id: string }, verb: Verb) =>
  ask("post", "/api/v1/jobs/{id}/{verb}", { path: { id: job.id, verb }, headers: { ...held(), ...requestKey() } });

const look = (id: string) => ask("get", "/api/v1/jobs/{id}", { path: { id } }) as Promise<Job>;

/** The newest job of a kind there is, of one session where that is given: what a view shows that is come back to. */
export async function newest(kind: string, session?: string): Promise<string> {
  const found = (await ask("get", "/api/v1/jobs", { query: { kind, session, limit: 1 } })) as { items: { id: string }[] };
  return found.items[0]?.id ?? "";
}

/** The job called ``id`` as it stands, until it has ended; null for none, or before anything is known. */
export function useJob<R = unknown>(id: string): Job<R> | null {
  const [job, show] = useState<Job | null>(null);
  useEffect(() => {
    let current = Boolean(id);
    const follow = async () => {
      const now = await look(id).catch(() => null);
      if (!current) return;
      if (now) show(now);
      if (!ended(now)) setTimeout(follow, LOOK_MS);
    };
    show(null);
    if (id) void follow();
    return () => void (current = false);
  }, [id]);
  return job as Job<R> | null;
}

/** The job of a kind that the bench does, whoever started it, else the newest there is; with what starts another. */
export function useWork<R = unknown>(kind: string, session?: string): [Job<R> | null, (id: string) => void] {
  const [id, follow] = useState("");
  useEffect(() => {
    let current = true;
    const find = (): Promise<unknown> =>
      newest(kind, session).then(
        (found) => current && found && follow((now) => now || found),
        (error) => current && unanswered(error) && setTimeout(find, LOOK_MS),
      );
    void find();
    return () => void (current = false);
  }, [kind, session]);
  useEffect(() => rig.subscribe((now) => void (now?.job?.kind === kind && (!session || now.job.session === session) && follow(now.job.id))), [kind, session]);
  return [useJob<R>(id), follow];
}
