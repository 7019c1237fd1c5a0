// Who is signed in here and what they may; the address that `rig serve` prints signs in once.
import { signal } from "@preact/signals";
import { Refused, get, onUnauthorised, post, type Schema } from "./api";
import { holder } from "./lease";
import { t } from "./texts";

export type Me = Schema["Me"];

export const me = signal<Me | null>(null);
export const entering = signal(true);
export const refusal = signal("");

export const may = (scope: Me["scopes"][number]) => Boolean(me.value?.scopes.includes(scope));

// As soon as whoever just started the service sees it.
const AGAIN_MS = 1000;
// Slower answers come, but by then somebody wonders.
const TOLD_MS = 3000;
const TOO_MANY = 429;

/** Whether another try may be answered otherwise: no answer came, or one of a service that is not ready. */
const passing = (error: unknown) => error instanceof Refused && (error.status === 0 || error.status === TOO_MANY || error.status >= 500);

async function enter(ticket: string | null): Promise<Me> {
  if (!ticket) return get("/api/v1/auth/me");
  return post("/api/v1/auth/ticket", { body: { ticket } }).catch((used: Error) =>
    // An address that is opened again: this browser may be signed in from the first time.
    get("/api/v1/auth/me").catch((mine: Error) => {
      throw passing(mine) ? mine : used;
    }),
  );
}

function accept(found: Me): void {
  me.value = found;
  refusal.value = "";
  if (found.name) holder.value = t.holderNamed(found.name);
}

const ticketHere = () => new URLSearchParams(location.hash.slice(1)).get("ticket");

/** Signs in as far as the address or an earlier visit allow, then does ``next``. */
export async function signIn(next: () => void): Promise<void> {
  onUnauthorised(() => {
    if (me.value) refusal.value = t.login.ended;
    me.value = null;
  });
  const ticket = ticketHere();
  // What signs in is not left in the address bar, nor in the history.
  if (ticket) history.replaceState(null, "", location.pathname);
  // Whoever puts a link into the address bar of a page that is open stays on that page.
  addEventListener("hashchange", () => ticketHere() && location.reload());
  const ask = async (): Promise<void> => {
    // What was sent is waited for: a ticket that it takes is good for no second.
    const hangs = setTimeout(() => {
      refusal.value = t.noAnswer;
      entering.value = false;
    }, TOLD_MS);
    try {
      accept(await enter(ticket));
      next();
    } catch (error) {
      // Whoever has not been here before is told how to come in, not that they are not in.
      refusal.value = error instanceof Refused && error.status === 401 && error.code !== "ticket" ? "" : (error as Error).message;
      if (passing(error)) setTimeout(ask, AGAIN_MS);
    }
    clearTimeout(hangs);
    entering.value = false;
  };
  await ask();
}

/** Signs in by a password; the page begins anew, so that nothing asked for before answers into it. */
export async function logIn(name: string, password: string): Promise<void> {
  await post("/api/v1/auth/login", { body: { name, password } });
  location.reload();
}

export async function signOut(): Promise<void> {
  await post("/api/v1/auth/logout");
  me.value = null;
  location.reload();
}
