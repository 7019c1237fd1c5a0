// Where we are, kept in the address after `#/`: a view, then what it shows.
import { signal } from "@preact/signals";

export const VIEWS = ["bench", "run", "sessions", "session", "track", "data", "subjects", "devices", "admin"] as const;
export type View = (typeof VIEWS)[number];

export interface Place {
  view: View;
  of: string;
}

/** What somebody typed may be no code of letters. */
function decoded(text: string): string {
  try {
    return decodeURIComponent(text);
  } catch {
    return text;
  }
}

function read(): Place {
  const [view, ...rest] = location.hash.replace(/^#\/?/, "").split("/");
  const known = VIEWS.find((one) => one === view);
  return { view: known ?? "bench", of: known ? decoded(rest.join("/")) : "" };
}

export const place = signal<Place>({ view: "bench", of: "" });

export const link = (view: View, of = "") => `#/${view}${of ? `/${encodeURIComponent(of)}` : ""}`;

export function go(view: View, of = ""): void {
  location.hash = link(view, of);
}

export function followAddress(): void {
  place.value = read();
  window.addEventListener("hashchange", () => {
    place.value = read();
    // A reader of the screen hears where it is now; the page itself does not jump.
    document.getElementById("view")?.focus({ preventScroll: true });
    window.scrollTo(0, 0);
  });
}
