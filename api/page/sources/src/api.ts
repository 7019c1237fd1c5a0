// The service's interface, typed from its own description: a route or a field that is gone fails the type check.
import type { components, paths } from "./openapi";
import { t } from "./texts";

export type Schema = components["schemas"];

/** Entries of one page of a list, as the service gives at most. */
const LARGEST_PAGE = 500;

type Method = "get" | "post" | "put" | "delete" | "patch";
type Routes<M extends Method> = { [P in keyof paths]: paths[P][M] extends object ? P : never }[keyof paths];
type Operation<P extends keyof paths, M extends Method> = paths[P][M];
type Json<A> = A extends { content: { "application/json": infer J } } ? J : undefined;
type Good<R> = R extends { 200: infer A } ? Json<A> : R extends { 201: infer A } ? Json<A> : R extends { 202: infer A } ? Json<A> : undefined;
export type Answer<P extends keyof paths, M extends Method> = Operation<P, M> extends { responses: infer R } ? Good<R> : never;
type Body<P extends keyof paths, M extends Method> =
  Operation<P, M> extends { requestBody?: { content: { "application/json": infer B } } } ? B : undefined;

export interface Sent<B> {
  path?: Record<string, string>;
  query?: Record<string, string | number | boolean | null | undefined>;
  body?: B;
  headers?: Record<string, string>;
  signal?: AbortSignal;
}

/** What the service refused, in its own words. */
export class Refused extends Error {
  constructor(
    readonly status: number,
    readonly code: string,
    detail: string,
    readonly more: Partial<Schema["Problem"]> = {},
  ) {
    super(detail);
  }
}

/** Whether no answer came at all: what only looks can be asked for again. */
export const unanswered = (error: unknown) => error instanceof Refused && error.status === 0;

const listeners: Array<() => void> = [];
/** Called whenever an answer says that nobody is logged in here. */
export function onUnauthorised(listener: () => void): void {
  listeners.push(listener);
}

export function address(path: string, sent: Sent<unknown> = {}): string {
  const filled = path.replace(/\{(\w+)(?::path)?\}/g, (_, name: string) =>
    encodeURIComponent(sent.path?.[name] ?? ""),
  );
  const query = Object.entries(sent.query ?? {}).filter(([, value]) => value !== undefined && value !== null && value !== "");
  return query.length ? `${filled}?${new URLSearchParams(query.map(([k, v]) => [k, String(v)]))}` : filled;
}

async function refused(response: Response): Promise<Refused> {
  const said = await response.json().catch(() => ({}));
  if (response.status === 401) for (const listener of listeners) listener();
  return new Refused(response.status, said.code ?? "", said.detail ?? said.title ?? `${response.status} ${response.statusText}`, said);
}

/** What the service tells repeats of one request from two requests by. */
export function requestKey(): Record<string, string> {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return { "Idempotency-Key": Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("") };
}

/** Also of an answer that broke off within. */
function lost(): never {
  throw new Refused(0, "no-answer", t.noAnswer);
}

async function answered(method: Method, path: string, sent: Sent<unknown>): Promise<Response> {
  const form = sent.body instanceof FormData;
  const headers = { ...(sent.body !== undefined && !form && { "Content-Type": "application/json" }), ...sent.headers };
  const body = sent.body === undefined ? undefined : form ? (sent.body as FormData) : JSON.stringify(sent.body);
  const request = { method: method.toUpperCase(), headers, body, signal: sent.signal, credentials: "same-origin" as const };
  const response = await fetch(address(path, sent), request).catch(lost);
  if (!response.ok) throw await refused(response);
  return response;
}

export async function ask(method: Method, path: string, sent: Sent<unknown> = {}): Promise<unknown> {
  const response = await answered(method, path, sent);
  return response.status === 204 ? undefined : response.json().catch(lost);
}

// What is being made for half a minute is not looked for more often.
const AGAIN_MS = 1000;

/** Saves a file that is made when it is first asked for, once it is there; its first byte says so. */
export async function save(path: string, sent: Sent<undefined>): Promise<void> {
  const headers = { Range: "bytes=0-0" };
  while ((await answered("get", path, { ...sent, headers })).status === 202) await new Promise((again) => setTimeout(again, AGAIN_MS));
  const link = Object.assign(document.createElement("a"), { href: address(path, sent), download: "" });
  link.click();
}

/** What was read, with the mark that a change of it has to name. */
export async function marked<T>(path: string, sent: Sent<undefined> = {}): Promise<{ value: T; mark: string }> {
  const response = await answered("get", path, sent);
  return { value: await response.json().catch(lost), mark: response.headers.get("ETag") ?? "" };
}

/** What is there, or null where nothing has been made yet. */
export const ifThere = <T>(path: string, sent: Sent<undefined> = {}): Promise<T | null> =>
  (ask("get", path, sent) as Promise<T>).catch((error: Error) => {
    if (error instanceof Refused && error.status === 404) return null;
    throw error;
  });

export const get = <P extends Routes<"get">>(path: P, sent: Sent<undefined> = {}) => ask("get", path, sent) as Promise<Answer<P, "get">>;
type Items<A> = A extends { items: readonly (infer I)[] } ? I : never;
type Page<P extends Routes<"get">> = { items: Items<Answer<P, "get">>[]; next?: string | null };

async function pages<P extends Routes<"get">>(path: P, many: number, only: Record<string, string>): Promise<Page<P>> {
  let page: Page<P> = { items: [], next: "" };
  const { items } = page;
  while (page.next != null && items.length < many) {
    const query = { ...only, limit: Math.min(many - items.length, LARGEST_PAGE), cursor: page.next };
    page = (await ask("get", path, { query })) as Page<P>;
    items.push(...page.items);
  }
  return { ...page, items };
}

/** The first ``many`` of a list that comes page by page, with all else that its last page says. */
export const upTo = <P extends Routes<"get">>(path: P, many: number) => pages(path, many, {}) as unknown as Promise<Answer<P, "get">>;

/** All of such a list, or ``only`` what a query of it leaves. */
export const every = async <P extends Routes<"get">>(path: P, only: Record<string, string> = {}) => (await pages(path, Infinity, only)).items;

export const post = <P extends Routes<"post">>(path: P, sent: Sent<Body<P, "post">> = {}) => ask("post", path, sent) as Promise<Answer<P, "post">>;
export const put = <P extends Routes<"put">>(path: P, sent: Sent<Body<P, "put">> = {}) => ask("put", path, sent) as Promise<Answer<P, "put">>;
export const remove = <P extends Routes<"delete">>(path: P, sent: Sent<undefined> = {}) => ask("delete", path, sent) as Promise<Answer<P, "delete">>;
