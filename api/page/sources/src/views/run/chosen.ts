// The protocol that was chosen last: kept for as long as the browser's window, over other views and a reload.
import { signal } from "@preact/signals";

const KEY = "protocol";

/** A browser that keeps nothing may refuse to be asked. */
function kept(): string {
  try {
    return sessionStorage.getItem(KEY) ?? "";
  } catch {
    return "";
  }
}

export const chosen = signal(kept());

export function choose(protocol: string): void {
  chosen.value = protocol;
  try {
    sessionStorage.setItem(KEY, protocol);
  } catch {
    // Then it is known until the page is loaded again.
  }
}
