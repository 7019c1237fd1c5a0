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

async function enter(): Promise<Me> {
  const ticket = new URLSearchParams(location.hash.slice(1)).get("ticket");
  if (!ticket) return get("/api/v1/auth/me");
  // What signs in is not left in the address bar, nor in the history.
  history.replaceState(null, "", location.pathname);
  return post("/api/v1/auth/ticket", { body: { ticket } }).catch((used: Error) =>
    // An address that is opened again: this browser may be signed in from the first time.
    get("/api/v1/auth/me").catch(() => {
      throw used;
    }),
  );
}

function accept(found: Me): void {
  me.value = found;
  refusal.value = "";
  if (found.name) holder.value = t.holderNamed(found.name);
}

/** Signs in as far as the address or an earlier visit allow, then does ``next``. */
export async function signIn(next: () => void): Promise<void> {
  onUnauthorised(() => {
    if (me.value) refusal.value = t.login.ended;
    me.value = null;
  });
  try {
    accept(await enter());
    next();
  } catch (error) {
    // Whoever has not been here before is told how to come in, not that they are not in.
    if (!(error instanceof Refused && error.status === 401 && error.code !== "ticket")) refusal.value = (error as Error).message;
  }
  entering.value = false;
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
