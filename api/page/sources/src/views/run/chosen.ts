// The protocol that was chosen last.
import { signal } from "@preact/signals";
import { keep, kept } from "../../kept";

const KEY = "protocol";

export const chosen = signal(kept(KEY));

export function choose(protocol: string): void {
  chosen.value = protocol;
  keep(KEY, protocol);
}
